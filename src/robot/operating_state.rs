//! The operating states of the robot.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// States of the robot (CRTK).
    OperatingState {
        /// Drives are off. The snake is limp within its friction.
        Disabled = 0, "DISABLED";
        /// Drives are on and servo commands are followed.
        Enabled = 1, "ENABLED";
        /// Drives are on and hold their position; servo commands are refused.
        Paused = 2, "PAUSED";
        /// Something failed. The robot holds or is off, whichever is possible. Latched until
        /// acknowledged.
        Fault = 3, "FAULT";
    }
}
