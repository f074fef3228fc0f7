//! Reasons for refusing a command.

use super::numbered_enum::numbered_enum;

/// Number of clients with a refusal entry: as many as can send at the same time.
pub const REFUSED_CLIENTS: usize = 8;

numbered_enum! {
    /// The reason for refusing a command. A refused command changes nothing.
    Refusal {
        /// Not refused.
        None = 0, "accepted";
        NotFinite = 1, "a value is not finite";
        /// The command was older than its deadline when it was read.
        Stale = 2, "stale: the command was older than its deadline when it arrived";
        /// The command is farther than `command.max_step_deg` (motors: `command.max_step_counts`)
        /// from the previous command, or than `first_step_*` from the present pose.
        StepTooLarge = 3, "step too large: too far from the previous command or the pose";
        Lease = 4, "another client holds the lease";
        /// The state is DISABLED, and the command needs ENABLED.
        NotEnabled = 5, "the drives are off";
        NotHomed = 6, "not homed: the zero of an axis is unknown";
        NoModel = 7, "no model is loaded";
        /// The number of entries is wrong, or an enum has no such number.
        Malformed = 8, "malformed command";
        Range = 9, "outside the position limits";
        /// The robot follows a goal of another kind, or the controller shuts down.
        WrongState = 10, "not possible while the robot follows commands, or while \
            the controller shuts down";
        Busy = 11, "busy: the previous command is still running";
        CausePersists = 12, "the cause of the fault persists";
        Sequence = 13, "the sequence number did not increase";
        Unsupported = 14, "not supported by this controller";
        /// The deadline is longer than allowed, or the stamp is in the future or decreases.
        Stamp = 15, "stamp in the future or older than the previous one, or deadline too long";
        /// The drives are not ready: they are starting, or the connection is lost.
        DrivesNotReady = 16, "the drives are not ready";
        /// Another model is staged, or no model is staged.
        NothingStaged = 17, "this model is not staged";
        NoPreviousModel = 18, "no previous model to return to";
        /// The hysteresis memory is unknown. The model would start on a wrong branch of the
        /// hysteresis loop.
        MemoryUnknown = 19, "the hysteresis memory is unknown: run a conditioning cycle, or use \
            --force";
        /// The model is invalid. The message gives the reason.
        BadModel = 20, "the controller refused the model";
        Conditioning = 21, "busy: the conditioning cycle is still running";
        /// The motion crosses a virtual fixture, or is not planned in angles while one is active.
        Fixture = 22, "a virtual fixture is in the way";
        /// The pose is outside the calibrated hull, the position limits or the joint limits.
        OutOfReach = 23, "the pose is out of reach";
        /// The client has no session: the robot was stopped since the session began; the client's
        /// stream fell silent or reached a limit while it moved the snake; or another client
        /// stopped the robot while this one was sending.
        StreamInterrupted = 24, "stream interrupted: (1) the robot was stopped, or (2) this \
            client's stream fell silent or reached a limit in motion";
        /// The state is PAUSED.
        Paused = 25, "paused: the robot holds until it is resumed";
        InFault = 26, "a fault is latched";
        NotDisabled = 27, "the drives are on";
        NoFault = 28, "there is no fault to acknowledge";
        /// A watchdog is running, but hangs or does not hold every port: it cannot stop the drives.
        WatchdogNotReady = 29, "the watchdog is running, but cannot stop every drive";
    }
}
