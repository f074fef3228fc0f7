//! Causes of the state FAULT.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// The cause of the state FAULT.
    Fault {
        /// No fault yet.
        None = 0, "none";
        /// A drive reports an error. Its error code gives the cause.
        Drive = 1, "a drive reports an error";
        /// A drive does not respond.
        Link = 2, "a drive does not answer";
        /// The following error is too large: setpoint and encoder differ too much.
        FollowingError = 3, "setpoint and encoder are too far apart";
        /// A drive left the enabled state by itself.
        DriveState = 4, "a drive left the enabled state by itself";
        /// A drive did not reach the demanded state in time.
        DriveTimeout = 5, "a drive did not reach the demanded state in time";
        /// Homing failed.
        Homing = 6, "homing failed";
        /// Internal: the model gave a value that is not finite.
        Model = 7, "the model gave a value that is not finite";
        /// Too many ticks were late.
        Late = 8, "too many late ticks: the computer does not keep up";
        /// The pose that the camera measures differs from the pose of the model.
        Implausible = 9, "the snake is not where the model says";
        /// A motor exceeds its current limit for too long.
        Current = 10, "a motor takes too much current for too long";
    }
}
