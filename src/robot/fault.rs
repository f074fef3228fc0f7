//! What led to FAULT.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// What led to FAULT.
    Fault {
        /// No fault yet.
        None = 0, "none";
        /// A drive reports an error; see its error code.
        Drive = 1, "a drive reports an error";
        /// A drive does not answer.
        Link = 2, "a drive does not answer";
        /// Set-point and encoder are too far apart.
        FollowingError = 3, "set-point and encoder are too far apart";
        /// A drive left the enabled state by itself.
        DriveState = 4, "a drive left the enabled state by itself";
        /// A drive could not be brought to the demanded state in time.
        DriveTimeout = 5, "a drive did not reach the demanded state in time";
        /// Homing ended without a zero.
        Homing = 6, "homing failed";
        /// Internal: the model gave a value that is not finite.
        Model = 7, "the model gave a value that is not finite";
        /// Too many late ticks.
        Late = 8, "too many late ticks: the computer does not keep up";
        /// The camera sees the snake elsewhere than the model.
        Implausible = 9, "the snake is not where the model says";
        /// A motor takes too much current for too long.
        Current = 10, "a motor takes too much current for too long";
    }
}
