//! Going on from the set-point after the controller stopped the snake.

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_terminal::Failure;

/// Set-points that do not change for so long are at rest, and how often they are read.
const REST: Nanos = Nanos::from_millis(100);
const REST_POLL: Nanos = Nanos::from_millis(5);
/// Longest wait for that.
const REST_TIMEOUT: Nanos = Nanos::from_millis(1000);

/// Printed when a stream goes on from the set-point.
pub const LOST_SETPOINT: &str = "the controller has stopped the snake, because commands came late \
     or none were read; the motion goes on from where it is";

/// Waits until the set-points rest, and returns them.
pub fn wait_for_rest<T: PartialEq>(
    mut read: impl FnMut() -> Result<T, Failure>,
) -> Result<T, Failure> {
    let start = clock::now();
    let (mut setpoints, mut changed) = (read()?, start);
    loop {
        clock::sleep(REST_POLL);
        let (newest, now) = (read()?, clock::now());
        if newest != setpoints {
            (setpoints, changed) = (newest, now);
        }
        // Set-points that somebody else moves are noticed by the lease.
        if now.since(changed) > REST || now.since(start) > REST_TIMEOUT {
            return Ok(setpoints);
        }
    }
}
