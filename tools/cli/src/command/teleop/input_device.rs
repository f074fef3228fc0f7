//! What an input device provides.

use i2ris::units::Nanos;

use crate::command::trajectory::Angles;

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct DeviceInput {
    /// The dead-man switch is held.
    pub engaged: bool,
    /// Share of the full speed, pitch and yaw, -1 to 1.
    pub velocity: Angles,
    /// Key presses since the last call, pitch and yaw.
    pub steps: [i32; 2],
    pub quit: bool,
}

pub(super) trait InputDevice {
    /// Its present state. Never waits.
    fn read(&mut self, now: Nanos) -> Result<DeviceInput, DeviceLost>;
    /// How to use it, in one line.
    fn help(&self) -> &'static str;
}

#[derive(Debug, thiserror::Error)]
#[error("{what}; the snake holds")]
pub struct DeviceLost {
    pub what: String,
}
