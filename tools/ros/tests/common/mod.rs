//! Emulated drives and a controller on them, `i2ris-ros` as a process, and a peer of ROS.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stderr,
    reason = "a test rig of which every test binary uses a part"
)]

pub mod bridge;
pub mod peer;
pub mod robot;

use i2ris::clock;
use i2ris::units::Nanos;

/// Time limit for operations that take milliseconds on an idle machine.
pub const TIMEOUT: Nanos = Nanos::from_millis(40_000);

/// Calls `attempt` until it returns a value.
pub fn eventually<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let end = clock::now() + TIMEOUT;
    loop {
        if let Some(value) = attempt() {
            return value;
        }
        assert!(clock::now() < end, "never: {what}");
        clock::sleep(Nanos::from_millis(2));
    }
}
