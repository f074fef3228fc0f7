//! Requests about models, and their replies.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;
use crate::units::{MAX_MOTORS, MAX_OUTPUTS};

payload! {
    /// `model`, request. The reply takes one or two ticks; for `stage` it can take seconds.
    ModelRequest "I2risModelRequestV2" {
        /// Identity of the client. Not 0.
        pub client_id: u64,
        /// Stamp, see [`StateCommandRequest`](super::StateCommandRequest).
        pub stamp_ns: u64,
        /// Validity, see [`StateCommandRequest`](super::StateCommandRequest).
        pub valid_ns: u64,
        /// [`crate::robot::ModelAction`].
        pub action: u32,
        /// Sum of [`ModelRequest::FORCE`] and [`ModelRequest::OTHER_DRIVE`].
        pub flags: u32,
        /// `activate`: SHA-256 of the staged model.
        pub model_id: [u8; 32],
        /// `stage`: absolute path of the model file as the controller sees it, padded with 0.
        pub path: [u8; 1024],
    }

    /// A loaded model.
    ModelSlot "I2risModelSlotV1" {
        /// Root mean square error on the training data, per output, in degrees (millimetres).
        pub training_rms: [f64; MAX_OUTPUTS],
        /// The same on held-out data; 0 without held-out data.
        pub held_out_rms: [f64; MAX_OUTPUTS],
        /// SHA-256 of the model; all 0: the slot is empty.
        pub model_id: [u8; 32],
        /// Its family, UTF-8, padded with 0.
        pub family: [u8; 32],
        /// Last part of its file path, UTF-8, padded with 0.
        pub file: [u8; 120],
        /// Number of outputs.
        pub outputs: u32,
        /// Sum of [`ModelSlot::PRESENT`] and [`ModelSlot::MEMORY_KNOWN`].
        pub flags: u32,
    }

    /// Difference between the staged model and the model in use.
    ModelDifference "I2risModelDifferenceV1" {
        /// Motor motion that keeps the angles at the estimate of the model in use, at the present
        /// position, counts.
        pub present_counts: [f64; MAX_MOTORS],
        /// The largest such motion over the hull, counts.
        pub largest_counts: [f64; MAX_MOTORS],
        /// Motor position of that maximum, counts.
        pub largest_at_counts: [f64; MAX_MOTORS],
        /// Share of the active model's hull that the staged model cannot reach, 0 to 1.
        pub unreached: f64,
        /// 1: valid; 0: no model in use, or the outputs differ.
        pub valid: u32,
        /// 0.
        pub reserved: u32,
    }

    /// `model`, reply.
    ModelReply "I2risModelReplyV1" {
        /// [`crate::robot::Refusal`]; 0: accepted.
        pub refusal: u32,
        /// 0.
        pub reserved: u32,
        /// The models in use, staged and previously in use, after the request.
        pub slots: [ModelSlot; 3],
        /// `stage`: how the staged model differs from the one in use.
        pub difference: ModelDifference,
        /// Reason in words, if the number is not enough; UTF-8, padded with 0.
        pub message: [u8; 512],
    }
}

impl ModelRequest {
    /// Flag: proceed although the hysteresis memory of the model is unknown.
    pub const FORCE: u32 = 1;
    /// Flag: stage although the model was calibrated with other settings of the drives.
    pub const OTHER_DRIVE: u32 = 2;
}

impl ModelSlot {
    /// Flag: the slot holds a model.
    pub const PRESENT: u32 = 1;
    /// Flag: the hysteresis memory of the model is known.
    pub const MEMORY_KNOWN: u32 = 2;
}
