//! The stream of the adaptation.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;

payload! {
    /// `adaptation`, out, 50 times a second; once a second while the adaptation is off: the drift
    /// from the calibration that the camera shows.
    ///
    /// Arrays of 14 are in the order zero of both outputs (rad), gain of output 0 by outputs 0 and
    /// 1, of output 1 by outputs 0 and 1, gap growth of both motors, camera latency (s), slow state
    /// (rad), preload loss of both motors beyond the gap and growth of half the play of both gears
    /// (shares of half the calibrated range).
    AdaptationMsg "I2risAdaptationV2": outgoing {
        /// SHA-256 of the model whose drift it is.
        pub model_id: [u8; 32],
        /// Estimate from the camera.
        pub estimate: [f64; 14],
        /// Standard deviation of `estimate`.
        pub deviation: [f64; 14],
        /// Applied correction. The slow state is part of the zero; the latency is not applied.
        pub applied: [f64; 14],
        /// Share of the budget that `estimate` uses.
        pub budget_used: [f64; 14],
        /// Share of the total budget, at the corners of the calibrated hull.
        pub total_used: f64,
        /// Root mean square distance between camera and calibrated model in the last window of
        /// 10 s, rad. 0: no window yet.
        pub calibrated_error: f64,
        /// The same of the adapted model.
        pub adapted_error: f64,
        /// Frames since the start: learned from.
        pub frames_used: u64,
        /// Too far from what was expected.
        pub frames_refused: u64,
        /// In order, while nothing was learned.
        pub frames_paused: u64,
        /// Dropped frames: duplicate, out of sequence, from the future, too old, too frequent, bad.
        pub frames_dropped: [u64; 6],
        /// Number of reverted corrections.
        pub taken_back: u32,
        /// 0: none, 1: filter, 2: integral.
        pub method: u32,
        /// Why learning is paused: sum of `Pause` values; 0: learning.
        pub pauses: u32,
        /// Bit `i` is set if the motion shows entry `i` of `estimate`.
        pub excited: u32,
        /// [`AdaptationMsg::ON`], or 0.
        pub flags: u32,
        /// 0.
        pub reserved: u32,
    }
}

impl AdaptationMsg {
    /// Flag: the adaptation is on.
    pub const ON: u32 = 1;
}
