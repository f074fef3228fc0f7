//! The targets of a task: to reach and hold, or to follow. The controller does not read them: they
//! are for monitors and recordings.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;
use crate::units::MAX_OUTPUTS;

payload! {
    /// `reach_target`, between clients: the target that a person shall reach and hold, 20 times a
    /// second while the task runs; or the one to follow, 100 times a second.
    ReachTarget "I2risReachTargetV1": message {
        /// Counts up by one per message of one client.
        pub sequence: u64,
        /// Time of the message.
        pub stamp_ns: u64,
        /// The client that runs the task.
        pub client_id: u64,
        /// When this target was shown first.
        pub shown_ns: u64,
        /// How long the snake has to stay within the tolerance; of [`ReachTarget::FOLLOW`]: the
        /// length of the task.
        pub hold_ns: u64,
        /// How long it has done so until now; how much of the task is over.
        pub held_ns: u64,
        /// Pitch and yaw of the target, rad.
        pub position: [f64; MAX_OUTPUTS],
        /// Distance within which the target is reached, rad.
        pub tolerance: f64,
        /// Number of the target, from 1.
        pub number: u32,
        /// Number of targets in the task.
        pub total: u32,
        /// Number of valid entries in `position`.
        pub count: u32,
        /// Sum of [`ReachTarget::ENDED`] and the other flags.
        pub flags: u32,
    }
}

impl ReachTarget {
    /// Flag: the last message of this target; it was held, or its time is over.
    pub const ENDED: u32 = 1;
    /// Flag: it was held.
    pub const HELD: u32 = 2;
    /// Flag: the camera judges; otherwise the model's estimate.
    pub const BY_CAMERA: u32 = 4;
    /// Flag: to be followed, whether it moves or rests; nothing is reached.
    pub const FOLLOW: u32 = 8;
    /// The first part of such a task, in which the person gets to the target: it does not count.
    pub const RUN_IN_NS: u64 = 3_000_000_000;
}
