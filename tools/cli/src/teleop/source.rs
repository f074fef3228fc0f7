//! Requests of the operator's hand, independent of the device.

use i2ris::units::Nanos;
use i2ris_teleop::clutch::Hand;
use nix::errno::Errno;

/// Request of the operator at a time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct HandRequest {
    pub hand: Hand,
    /// Key presses since the last call, right and up in the image.
    pub steps: [f64; 2],
    pub quit: bool,
    /// Stop the robot, whichever client commands it, and quit.
    pub stop: bool,
}

pub(super) trait Source {
    /// The present request. Never waits.
    fn read(&mut self, now: Nanos) -> Result<HandRequest, SourceLost>;
    /// Waits until there is a new event, or until `until`.
    fn wait(&mut self, until: Nanos) {
        i2ris::clock::sleep_until(until);
    }
    /// Pulses the device, if it can.
    fn pulse(&mut self) {}
    /// A message to print once.
    fn news(&mut self) -> Option<String> {
        None
    }
    /// Usage, in one line.
    fn help(&self) -> String;
}

#[derive(Debug, thiserror::Error)]
#[error("the terminal is gone ({0}); the snake holds")]
pub struct SourceLost(pub Errno);
