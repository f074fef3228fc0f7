//! The operating states of the robot.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// States of the robot (CRTK).
    OperatingState {
        /// The drives are off. Only friction holds the snake.
        Disabled = 0, "DISABLED";
        /// The drives are on. Servo commands are followed.
        Enabled = 1, "ENABLED";
        /// The drives are on and hold their position. Servo commands are refused.
        Paused = 2, "PAUSED";
        /// A fault occurred. The robot holds its position if possible, or the drives are off. The
        /// state is latched until the fault is acknowledged.
        Fault = 3, "FAULT";
    }
}
