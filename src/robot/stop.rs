//! Reasons for stops that nobody asked for, and for goals that are not followed exactly.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// The reason for a stop that nobody asked for. The robot stays ENABLED and holds; the next
    /// accepted command moves it again. Or the end of what would have stopped it.
    Stop {
        /// The followed client exceeded its deadline.
        Stale = 1, "commands came later than their deadline, and the robot stopped in between";
        /// The drives reported no recent position, or an axis lost its zero.
        Feedback = 2, "a drive gave no recent position, and the motion stopped";
        /// The watchdog ended, hangs, or lost a port.
        Watchdog = 3, "no watchdog watches: nothing stops the drives if the controller dies";
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
