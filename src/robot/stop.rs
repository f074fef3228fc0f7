//! Reasons for stops that nobody asked for, and for goals that are not followed exactly.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// The reason for a stop that nobody asked for. The robot stays ENABLED and holds; the next
    /// accepted command moves it again. Or the end of what would have stopped it. Or what broke off
    /// an activity that a command had begun.
    Stop {
        /// The followed client exceeded its deadline.
        Stale = 1, "commands came later than their deadline, and the robot stopped in between";
        /// The drives reported no recent position, or an axis lost its zero.
        Feedback = 2, "a drive gave no recent position, and the motion stopped";
        /// The watchdog ended, hangs, or lost a port.
        Watchdog = 3, "no watchdog watches: nothing stops the drives if the controller dies";
        /// A later command: `hold`, `pause`, `disable`, or the end of the controller.
        Command = 4, "a later command broke it off";
        /// A virtual fixture came into the way.
        Fixture = 5, "a virtual fixture came into the way and broke it off";
        /// The setpoints could not go on within their limits.
        Limit = 6, "the limits of the motors or joints broke it off";
        /// A fault.
        Fault = 7, "a fault broke it off";
    }
}

numbered_enum! {
    /// The reason for following a nearer goal than the one asked for.
    Clip {
        /// The goal is outside the hull of the calibration or the position limits.
        Reach = 1, "the goal is outside the calibrated hull or the position limits";
        /// A virtual fixture is near or in the way.
        Fixture = 2, "a virtual fixture slows or stops the goal";
    }
}
