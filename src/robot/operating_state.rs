//! The operating states of the robot, causes of FAULT, and reasons for uncommanded stops.

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
        None = 0, "none"
            => "read the controller's log, then `i2ris command state acknowledge`";
        /// A drive reports an error. Its error code gives the cause.
        Drive = 1, "a drive reports an error"
            => "look up the error code in the drive's manual; then `i2ris command state \
                acknowledge`";
        Link = 2, "a drive does not answer"
            => "check cable and supply (`i2ris doctor`); then `i2ris command state acknowledge`";
        FollowingError = 3, "following error too large"
            => "free the mechanism, raise `current_limit_ma`, or command slower motion; then \
                `i2ris command state acknowledge`";
        DriveState = 4, "a drive left the enabled state unexpectedly"
            => "check STO and supply, and close EPOS Studio; then `i2ris command state \
                acknowledge`";
        DriveTimeout = 5, "a drive did not reach the requested state in time"
            => "read why in the controller's log; then `i2ris command state acknowledge`, and \
                repeat if the computer was busy, or `i2ris doctor`";
        Homing = 6, "homing failed"
            => "read why in the controller's log; check the keys `homing_*` of the axis; then \
                `i2ris command state acknowledge`";
        Model = 7, "the model gave a value that is not finite"
            => "save the black box (`i2ris record replay`) and report it";
        Late = 8, "too many late ticks, or a suspend: the computer cannot keep up"
            => "reduce the load on the computer, do not let it sleep, or grant real-time \
                permission; then `i2ris command state acknowledge`";
        /// The pose measured by the camera differs from the model's; either may be wrong.
        Implausible = 9, "camera and model disagree on the pose"
            => "check camera, wires, zero and model; then `i2ris command state acknowledge`";
        Current = 10, "motor over-current for too long"
            => "free the mechanism and inspect the snake; then `i2ris command state acknowledge`";
    }
}

numbered_enum! {
    /// The reason for an uncommanded stop: the robot stays ENABLED and holds, and the next accepted
    /// command moves it again. Also the loss of the watchdog, which stops nothing, and the reasons
    /// for interrupting an activity that a command had started.
    Stop {
        /// The followed client exceeded its deadline.
        Stale = 1, "commands arrived after their deadline; the robot stopped in between"
            => "send faster, or use a longer deadline; check the load on the computer";
        /// The drives reported no recent position, or an axis lost its zero.
        Feedback = 2, "no recent position from a drive, or an axis lost its zero; the motion \
            stopped"
            => "missed ticks (`i2ris status`): reduce the load; else check cable and supply \
                (`i2ris doctor`); zero lost: home again";
        /// The watchdog ended, hung, or lost a port. The robot itself has not stopped.
        Watchdog = 3, "no active watchdog: nothing will stop the drives if the controller dies; \
            the robot has not stopped"
            => "start `i2ris-watchdog --config FILE` again and read its log";
        /// A later command (`hold`, `pause`, `disable`) or the shutdown of the controller.
        Command = 4, "move, homing or conditioning interrupted by a later command"
            => "find the sender (`i2ris status`), then repeat the command";
        /// A virtual fixture blocks the motion.
        Fixture = 5, "interrupted: a virtual fixture is in the way"
            => "switch the fixtures off (`i2ris command fixture off`), then repeat the command";
        Limit = 6, "interrupted: motor or joint position limit reached"
            => "start further inside the limits, or correct them";
        /// A fault.
        Fault = 7, "interrupted by a fault"
            => "remove the cause (`i2ris status`), then repeat the command";
        Hull = 8, "interrupted: border of the calibrated range reached"
            => "start further inside the calibrated range, or calibrate a wider one";
        Speed = 9, "interrupted: velocity or acceleration limit of the joints reached"
            => "raise the rates in `joint_limits`, or, if the model jumps there, calibrate again";
        Setpoint = 10, "a drive did not accept its setpoints; the motion stopped"
            => "`i2ris disable`, then find in the log which object the drive refuses";
    }
}

numbered_enum! {
    /// The reason for following a nearer goal than the requested one.
    Clip {
        Reach = 1, "the goal is outside the calibrated range; the snake goes to the nearest pose"
            => "command a smaller angle, or calibrate a wider range";
        /// A virtual fixture is near or in the way.
        Fixture = 2, "a virtual fixture slows or stops the motion"
            => "go around the region (`i2ris command fixture list`)";
        Motor = 3, "the goal is beyond a position limit of a motor; the snake goes to the nearest \
            pose"
            => "command a smaller angle, or check `position_min_counts`, `position_max_counts`";
        Joint = 4, "the goal is beyond a joint limit; the snake goes to the nearest pose"
            => "command a smaller angle, or check the positions in `joint_limits`";
    }
}
