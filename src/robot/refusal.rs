//! Reasons for refusing a command.

/// Number of clients with a refusal entry: as many as can send at the same time.
pub const REFUSED_CLIENTS: usize = 8;

numbered_enum! {
    /// The reason for refusing a command. A refused command changes nothing.
    Refusal {
        /// Not refused.
        None = 0, "accepted"
            => "nothing";
        NotFinite = 1, "a value is not finite"
            => "fix the client: it sends NaN or an infinite value";
        /// The command was older than its deadline when it was read.
        Stale = 2, "stale: the command was older than its deadline when it arrived"
            => "send faster; stamp with the monotonic clock of this computer";
        /// The command is farther than `command.max_step_deg` (motors: `command.max_step_counts`)
        /// from the previous command, or than `first_step_*` from the present pose.
        StepTooLarge = 3, "step too large: too far from the previous command or the pose"
            => "start at `setpoint_js` and interpolate: at most `command.max_step_deg` per command \
                (motors: `max_step_counts`)";
        Lease = 4, "another client holds the lease"
            => "end the other client, or wait until it stops sending (`i2ris status`)";
        /// The state is DISABLED, and the command needs ENABLED.
        NotEnabled = 5, "the drives are off"
            => "`i2ris enable`";
        NotHomed = 6, "not homed: the zero of an axis is unknown"
            => "straighten the snake, then `i2ris home`";
        NoModel = 7, "no model is loaded"
            => "`i2ris model use FILE`, or name it in the configuration";
        /// The number of entries is wrong, or an enum has no such number.
        Malformed = 8, "malformed command"
            => "fix the client: number of values, flags and client id";
        Range = 9, "outside the position limits, a move longer than 60 s, or more than 8 fixtures"
            => "correct the command, the fixtures or the limits (`position_min_counts`, \
                `position_max_counts`, `joint_limits`)";
        /// The robot follows a goal of another kind, or the controller shuts down.
        WrongState = 10, "not possible while the robot follows commands, or while \
            the controller shuts down"
            => "`i2ris command state hold`; if the controller is shutting down, start it again";
        Busy = 11, "busy: the previous command is still running"
            => "wait until it is done, or send `i2ris command state hold` and wait 1 s";
        CausePersists = 12, "the cause of the fault persists"
            => "remove the cause of the fault first";
        Sequence = 13, "the sequence number did not increase"
            => "fix the client: increase the sequence number by one per command";
        Unsupported = 14, "not supported by this controller"
            => "use a model whose outputs are angles, or another command";
        /// The deadline is longer than allowed, or the stamp is in the future or decreases.
        Stamp = 15, "stamp in the future or older than the previous one, or deadline too long"
            => "stamp with the monotonic clock of this computer, in sending order; use a deadline \
                of at most 1 s";
        /// The drives are not ready: they are starting, or the connection is lost.
        DrivesNotReady = 16, "the drives are not ready"
            => "wait for the drives to start; if they do not, run `i2ris doctor`";
        /// Another model is staged, or no model is staged.
        NothingStaged = 17, "this model is not staged"
            => "`i2ris model use FILE`; `i2ris model show` lists what is loaded";
        NoPreviousModel = 18, "no previous model to return to"
            => "`i2ris model use FILE` instead";
        /// The hysteresis memory is unknown: the model would start on a wrong branch.
        MemoryUnknown = 19, "the hysteresis memory is unknown: run a conditioning cycle, or use \
            --force"
            => "`i2ris command state condition`, or `--force`";
        /// The model is invalid. The message gives the reason.
        BadModel = 20, "the controller refused the model"
            => "read the reason in the controller's reply to `i2ris model use`";
        Conditioning = 21, "busy: the conditioning cycle is still running"
            => "wait until it is done, or send `i2ris command state hold` and wait 1 s";
        /// The motion crosses a virtual fixture, or is not planned in angles while one is active.
        Fixture = 22, "a virtual fixture is in the way"
            => "go around the region (`i2ris command fixture list`), or switch the fixtures off";
        /// The pose is outside the calibrated hull, the position limits or the joint limits.
        OutOfReach = 23, "the pose is out of reach"
            => "command a smaller angle, or calibrate a wider range";
        /// The client has no session: the robot was stopped since the session began; the client's
        /// stream fell silent or reached a limit while it moved the snake; or another client
        /// stopped the robot while this one was sending.
        StreamInterrupted = 24, "stream interrupted: (1) the robot was stopped, or (2) this \
            client's stream fell silent or reached a limit in motion"
            => "(1) read `i2ris status`, (2) fix the stream; stay silent for 1 s, send `hold` as \
                this client, then restart from `setpoint_js`";
        /// The state is PAUSED.
        Paused = 25, "paused: the robot holds until it is resumed"
            => "`i2ris command state resume`";
        InFault = 26, "a fault is latched"
            => "remove the cause of the fault (`i2ris status`), then `i2ris command state \
                acknowledge`";
        NotDisabled = 27, "the drives are on"
            => "`i2ris disable`";
        NoFault = 28, "there is no fault to acknowledge"
            => "continue; no action is needed";
        /// A watchdog is running, but hangs or does not hold every port: it cannot stop the drives.
        WatchdogNotReady = 29, "the watchdog is running, but cannot stop every drive"
            => "give the watchdog access to every port (see its log), or end it (see `i2ris \
                doctor`): the robot then runs without a watchdog";
    }
}
