//! What a hand asks, whatever it holds.

use i2ris::units::Nanos;
use i2ris_teleop::clutch::Open;
use nix::errno::Errno;

/// What a hand asks at a time. Directions are those of the picture: to the right, and up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HandRequest {
    /// Why the snake does not follow; `None`: it may.
    pub open: Option<Open>,
    /// Deflection, each -1 to 1.
    pub push: [f64; 2],
    /// Key presses since the last call.
    pub steps: [f64; 2],
    /// How often the next scale was asked for since the last call.
    pub scale_steps: u32,
    /// How often a mark of the trial was asked for since the last call.
    pub marks: u32,
    /// When the newest event since the last call came to the computer, where that is known.
    pub newest: Option<Nanos>,
    pub quit: bool,
    /// Stop the robot, whoever commands it, and end.
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
    /// What it asks now. Never waits.
    fn read(&mut self, now: Nanos) -> Result<HandRequest, SourceLost>;
    /// Waits until it has something new, or until that time.
    fn wait(&mut self, until: Nanos) {
        i2ris::clock::sleep_until(until);
    }
    /// Lets the hand feel a limit, where the device can.
    fn pulse(&mut self) {}
    /// Something that has to be said once.
    fn news(&mut self) -> Option<String> {
        None
    }
    /// How to use it, in one line.
    fn help(&self) -> String;
}

#[derive(Debug, thiserror::Error)]
#[error("the terminal is gone ({0}); the snake holds")]
pub struct SourceLost(pub Errno);
