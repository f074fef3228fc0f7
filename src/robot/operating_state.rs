//! The operating states of the robot, causes of FAULT, and reasons for uncommanded stops.

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
        Link = 2, "a drive does not answer";
        FollowingError = 3, "following error too large";
        DriveState = 4, "a drive left the enabled state unexpectedly";
        DriveTimeout = 5, "a drive did not reach the requested state in time";
        Homing = 6, "homing failed";
        Model = 7, "the model gave a value that is not finite";
        Late = 8, "too many late ticks: the computer cannot keep up";
        /// The pose measured by the camera differs from the model's; either may be wrong.
        Implausible = 9, "camera and model disagree on the pose";
        Current = 10, "motor over-current for too long";
    }
}

numbered_enum! {
    /// The reason for an uncommanded stop: the robot stays ENABLED and holds, and the next accepted
    /// command moves it again. Also the loss of the watchdog, which stops nothing, and the reasons
    /// for interrupting an activity that a command had started.
    Stop {
        /// The followed client exceeded its deadline.
        Stale = 1, "commands arrived after their deadline; the robot stopped in between";
        /// The drives reported no recent position, or an axis lost its zero.
        Feedback = 2, "no recent position from a drive, or an axis lost its zero; the motion \
            stopped";
        /// The watchdog ended, hung, or lost a port. The robot itself has not stopped.
        Watchdog = 3, "no active watchdog: nothing will stop the drives if the controller dies; \
            the robot has not stopped";
        /// A later command (`hold`, `pause`, `disable`) or the shutdown of the controller.
        Command = 4, "move, homing or conditioning interrupted by a later command";
        /// A virtual fixture blocks the motion.
        Fixture = 5, "interrupted: a virtual fixture is in the way";
        Limit = 6, "interrupted: motor or joint position limit reached";
        /// A fault.
        Fault = 7, "interrupted by a fault";
        Hull = 8, "interrupted: border of the calibrated range reached";
        Speed = 9, "interrupted: velocity or acceleration limit of the joints reached";
        Setpoint = 10, "a drive did not accept its setpoints; the motion stopped";
    }
}

numbered_enum! {
    /// The reason for following a nearer goal than the requested one.
    Clip {
        Reach = 1, "the goal is outside the calibrated range; the snake goes to the nearest pose";
        /// A virtual fixture is near or in the way.
        Fixture = 2, "a virtual fixture slows or stops the motion";
        Motor = 3, "the goal is beyond a position limit of a motor; the snake goes to the nearest \
            pose";
        Joint = 4, "the goal is beyond a joint limit; the snake goes to the nearest pose";
    }
}
