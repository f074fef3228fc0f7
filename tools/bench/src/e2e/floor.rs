//! The same through a bare loop: a set-point in memory, a loop that hands it to the line, the
//! position back in memory.

use std::sync::atomic::Ordering;
use std::thread;

use i2ris::clock;
use i2ris::realtime::{Wanted, request};
use i2ris::units::Nanos;

use super::client::Pauses;
use super::join::{Joined, Reading, Watched, Written, joined};
use super::{EndToEnd, LOOK};
use crate::bare::{self, Shared};
use crate::error::BenchError;
use crate::wire::Rig;

/// Commands a bare loop on the first port.
pub fn run(rig: &Rig, of: &EndToEnd, interrupted: &dyn Fn() -> bool) -> Result<Joined, BenchError> {
    let (shared, port) = (Shared::default(), rig.port(0));
    let watched = thread::scope(|scope| {
        let serving = scope.spawn(|| bare::serve(&port, of.priority.saturating_sub(10), &shared));
        let commanding = scope.spawn(|| {
            let _ = request(Wanted {
                priority: of.priority.saturating_sub(20),
                ..Wanted::default()
            });
            command(&shared, of)
        });
        while !commanding.is_finished() && !serving.is_finished() && !interrupted() {
            clock::sleep(Nanos::from_millis(10));
        }
        shared.stop.store(true, Ordering::Release);
        let died = |_| BenchError::Nothing {
            what: "a thread of the bare loop ended without a word",
        };
        let watched = commanding.join().map_err(died)?;
        serving.join().map_err(died)??;
        Ok::<_, BenchError>(watched)
    })?;
    if interrupted() {
        return Err(BenchError::Interrupted);
    }
    Ok(joined(&watched, &rig.emulator.log()))
}

fn command(shared: &Shared, of: &EndToEnd) -> Watched {
    let (mut watched, mut pauses) = (Watched::default(), Pauses::new(of.seed));
    for number in 0..of.commands {
        let now = clock::now();
        let next = now + pauses.next();
        // Every set-point differs from the one before, so that it is known again.
        let counts = (number % 200) as i32;
        shared.target.store(counts, Ordering::Release);
        watched.written[0].push(Written {
            command: now,
            written: Nanos::ZERO,
            counts,
        });
        watched.sent += 1;
        while clock::now() < next {
            if shared.stop.load(Ordering::Acquire) {
                return watched;
            }
            let measured = Nanos(shared.measured_ns.load(Ordering::Acquire));
            if watched.readings[0]
                .last()
                .is_none_or(|reading| reading.measured < measured)
            {
                watched.readings[0].push(Reading {
                    measured,
                    seen: clock::now(),
                });
            }
            clock::sleep(LOOK);
        }
    }
    watched
}
