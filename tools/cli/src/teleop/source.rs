//! Requests of the operator's hand, independent of the device.

use i2ris::units::Nanos;
use i2ris_teleop::clutch::Open;
use nix::errno::Errno;

/// Request of the hand at a time. Directions are those of the image: right, and up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HandRequest {
    /// Why the snake does not follow; `None`: it may follow.
    pub open: Option<Open>,
    /// Deflection, each -1 to 1.
    pub push: [f64; 2],
    /// Key presses since the last call.
    pub steps: [f64; 2],
    /// Requests for the next scale since the last call.
    pub scale_steps: u32,
    /// Requests for a trial mark since the last call.
    pub marks: u32,
    /// Arrival of the newest event since the last call, if known.
    pub newest: Option<Nanos>,
    pub quit: bool,
    /// Stop the robot, whichever client commands it, and quit.
    pub stop: bool,
}

impl Default for HandRequest {
    fn default() -> Self {
        Self {
            open: Some(Open::Released),
            push: [0.0; 2],
            steps: [0.0; 2],
            scale_steps: 0,
            marks: 0,
            newest: None,
            quit: false,
            stop: false,
        }
    }
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
