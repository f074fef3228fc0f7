//! Plays a scenario.

use i2ris::clock;
use i2ris::units::Nanos;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::scenario::Scenario;
use super::shared::Shared;

/// Poll period.
const POLL: Nanos = Nanos::from_millis(1);

/// Plays a scenario until the emulator ends.
pub(crate) fn play(shared: &Shared, scenario: &Scenario, seed: u64) {
    let start = clock::now();
    let mut random = Pcg64Mcg::seed_from_u64(scenario.seed.unwrap_or(seed));
    let mut fixed = scenario.at.iter().peekable();
    let mut next_ms = scenario.random.as_ref().map_or(0, |drawn| drawn.every_ms);
    while !shared.is_stopping() {
        let is_due = |ms: u64| start + Nanos::from_millis(ms) <= clock::now();
        while let Some(timed) = fixed.next_if(|timed| is_due(timed.ms)) {
            shared.inject(timed.axis, timed.injection);
        }
        if let Some(drawn) = scenario.random.as_ref().filter(|_| is_due(next_ms)) {
            let (injection, wait_ms) = drawn.draw(&mut random);
            if let Some(injection) = injection {
                shared.inject(random.random_range(0..2), injection);
            }
            next_ms += wait_ms;
        }
        clock::sleep(POLL);
    }
}
