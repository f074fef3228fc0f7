//! Replaying captures of lines.

use i2ris::drive::capture::file::{from_bytes, to_bytes};
use i2ris::drive::capture::{CapturedPort, LineEvent, Outcome};
use i2ris::drive::link::replay::replay;
use i2ris::units::Nanos;

/// Frames of requests and replies, and the number of outcomes without an answer, all replayed.
pub fn replayed(port: &CapturedPort) -> (u64, usize) {
    let file = from_bytes(&to_bytes(std::slice::from_ref(port), "test", Nanos::ZERO)).unwrap();
    assert_eq!(file.ports, std::slice::from_ref(port));
    let found = replay(port);
    assert!(found.differences.is_empty() && found.skipped == 0, "{found:?}");
    let outcomes = port.events.iter().filter_map(LineEvent::outcome);
    let failures = outcomes.filter(|it| !matches!(it, Outcome::Answered(_))).count();
    (2 * found.attempts, failures)
}
