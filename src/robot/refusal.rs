//! Why a command is refused.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// Why a command is refused. Refused commands change nothing.
    Refusal {
        /// Not refused.
        None = 0, "accepted";
        /// A number that is not finite.
        NotFinite = 1, "a value is not finite";
        /// Older than its deadline when it was read.
        Stale = 2, "stale: the command was older than its deadline when it arrived";
        /// Too far from the command before, or from the present pose.
        Step = 3, "step too large: commands may move only a little at a time";
        /// Someone else commands.
        Lease = 4, "another client holds the lease";
        /// Not in state ENABLED.
        NotEnabled = 5, "not enabled";
        /// An axis does not know its zero.
        NotHomed = 6, "not homed: an axis does not know its zero";
        /// Angles were asked for, but no model is loaded.
        NoModel = 7, "no model is loaded";
        /// Wrong number of entries, or a number that no enum knows.
        Malformed = 8, "malformed command";
        /// Outside the position limits of an axis.
        Range = 9, "outside the position limits";
        /// The state does not allow this command.
        State = 10, "not allowed in this state";
        /// A former change of state is under way.
        Busy = 11, "busy: a former command is being carried out";
        /// The cause of the fault is still there.
        CausePersists = 12, "the cause of the fault is still there";
        /// Sequence number not above the one before.
        Sequence = 13, "sequence number did not rise";
        /// Known, but this controller cannot do it.
        Unsupported = 14, "not supported by this controller";
        /// Deadline longer than allowed, or stamp in the future.
        Stamp = 15, "stamp in the future or deadline too long";
        /// Drives are not ready: still starting, or lost.
        DrivesNotReady = 16, "the drives are not ready";
        /// Another model is staged, or none.
        NothingStaged = 17, "this model is not staged";
        /// No model was in use before.
        NoFormer = 18, "no model was in use before this one";
        /// The hysteresis memory is not known, so the model would start on a wrong branch of the
        /// loop.
        MemoryUnknown = 19, "the hysteresis memory is unknown: condition first, or force it";
        /// The model cannot be used; the message says why.
        BadModel = 20, "the model is refused";
    }
}
