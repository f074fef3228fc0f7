//! The operating states of the robot, causes of FAULT, and reasons for stops that nobody asked for.

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
        /// The setpoints could not go on within the position limits.
        Limit = 6, "a position limit of the motors or joints broke it off";
        /// A fault.
        Fault = 7, "a fault broke it off";
        /// The setpoints could not go on within the calibrated hull.
        Hull = 8, "the border of the calibrated range broke it off";
        /// The setpoints could not go on within the velocity limits of the joints.
        Speed = 9, "the velocity or acceleration limit of the joints broke it off";
        /// A drive was not given its setpoint in time, or refused it.
        Setpoint = 10, "a drive did not take its setpoints, and the motion stopped";
    }
}

numbered_enum! {
    /// The reason for following a nearer goal than the one asked for.
    Clip {
        /// The goal is outside the hull of the calibration.
        Reach = 1, "the goal is outside the calibrated range; the snake goes to the nearest pose";
        /// A virtual fixture is near or in the way.
        Fixture = 2, "a virtual fixture slows or stops the goal";
        /// The goal is beyond the position limits of the motors.
        Motor = 3, "the goal is beyond a position limit of a motor; the snake goes to the nearest pose";
        /// The goal is beyond the position limits of the joints.
        Joint = 4, "the goal is beyond a joint limit; the snake goes to the nearest pose";
    }
}
