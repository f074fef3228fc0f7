//! Report and events of the adaptation.

use serde::{Deserialize, Serialize};

use crate::core::drift::{Drift, PARAMETERS};
use crate::model::ModelId;

/// The adaptation after one tick.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct AdaptationReport {
    /// The model that drifts; `None` without a model.
    pub model: Option<ModelId>,
    /// Method of estimating the drift.
    pub method: Method,
    /// Drift estimated from the camera frames.
    pub estimate: Drift,
    /// Standard deviations of the estimate, in the order of [`super::Parameter::ALL`].
    pub deviations: [f64; PARAMETERS],
    /// Applied correction. The slow state is part of the zero.
    pub applied: Drift,
    /// Share of the budget that every parameter of the estimate uses.
    pub budget_used: [f64; PARAMETERS],
    /// Share of the total budget, at the corners of the hull.
    pub total_used: f64,
    /// Whether the motion shows a parameter.
    pub excited: [bool; PARAMETERS],
    /// Reasons not to learn.
    pub pauses: Pauses,
    /// Frames since the start.
    pub frames: FrameCounts,
    /// Root mean square distance between camera and calibrated model in the last window, rad.
    pub calibrated_error: f64,
    /// The same for the adapted model.
    pub adapted_error: f64,
    /// Number of times that the correction was reverted.
    pub taken_back: u32,
}

/// Method of estimating the drift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Method {
    /// No estimate: no model, or its outputs are not angles, or not as many as motors.
    #[default]
    None,
    /// Zero, gain, gap and latency, by a Kalman filter.
    Filter,
    /// The zero alone, by a slow integral: the family has no gaps that could be scaled.
    Integral,
}

/// A reason not to learn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u32)]
pub enum Pause {
    /// No goal is followed, or the clutch is open.
    NotFollowing = 1,
    /// A fault, a swap, a conditioning cycle or the start is less than 2 s ago.
    Settling = 2,
    /// The hysteresis memory is not known.
    MemoryUnknown = 4,
    /// The motors are outside of the calibrated hull.
    OutsideHull = 8,
    /// No frame arrives.
    NoCamera = 16,
    /// Most frames are refused: a wrong camera, or a push from outside.
    CameraRejected = 32,
    /// The budget is used up: calibrate.
    BudgetUsed = 64,
    /// The adapted model was worse than the calibrated model and was reverted.
    Reverted = 128,
    /// Too little motion.
    NoMotion = 256,
    /// The zero has slipped twice since the robot was disabled: something else moved.
    SlippedAgain = 512,
}

impl Pause {
    /// All reasons.
    pub const ALL: [Self; 10] = [
        Self::NotFollowing,
        Self::Settling,
        Self::MemoryUnknown,
        Self::OutsideHull,
        Self::NoCamera,
        Self::CameraRejected,
        Self::BudgetUsed,
        Self::Reverted,
        Self::NoMotion,
        Self::SlippedAgain,
    ];

    /// Text of the reason.
    pub const fn text(self) -> &'static str {
        match self {
            Self::NotFollowing => "not following a goal",
            Self::Settling => "settling for 2 s",
            Self::MemoryUnknown => "memory unknown",
            Self::OutsideHull => "outside the hull",
            Self::NoCamera => "no camera",
            Self::CameraRejected => "most frames rejected",
            Self::BudgetUsed => "budget used up: recalibrate",
            Self::Reverted => "correction reverted",
            Self::NoMotion => "too little motion",
            Self::SlippedAgain => "the zero shifted twice: check camera and wires, then disable",
        }
    }
}

/// Reasons not to learn, as bits of [`Pause`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Pauses(pub u32);

impl Pauses {
    /// Learning.
    pub const NONE: Self = Self(0);

    /// Adds a reason, if it holds.
    pub fn with(self, pause: Pause, holds: bool) -> Self {
        Self(self.0 | if holds { pause as u32 } else { 0 })
    }

    /// Whether present frames do not show the drift. Lack of motion and a rejected camera are
    /// detected and ended by frames, so they do not count here; the applied correction is scored
    /// even when learning has stopped.
    pub(super) fn look_away(self) -> bool {
        [Pause::NotFollowing, Pause::Settling, Pause::MemoryUnknown, Pause::OutsideHull]
            .into_iter()
            .any(|pause| self.contains(pause))
    }

    /// Whether a reason holds.
    pub fn contains(self, pause: Pause) -> bool {
        self.0 & pause as u32 != 0
    }

    /// The reasons that hold.
    pub fn iter(self) -> impl Iterator<Item = Pause> {
        Pause::ALL.into_iter().filter(move |pause| self.contains(*pause))
    }
}

/// Frames since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FrameCounts {
    /// Used for learning.
    pub used: u64,
    /// Too far from the expected pose.
    pub refused: u64,
    /// Usable, while learning was paused.
    pub paused: u64,
    /// Same stamp as the previous frame.
    pub duplicate: u64,
    /// Older than a previous frame.
    pub out_of_order: u64,
    /// Stamped later than now.
    pub future: u64,
    /// Older than the ring of regressors.
    pub too_old: u64,
    /// Less than 10 ms after the previous frame.
    pub too_frequent: u64,
    /// Not finite, wrong number of outputs, or poor quality.
    pub bad: u64,
}
