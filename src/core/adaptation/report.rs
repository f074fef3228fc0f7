//! Report and events of the adaptation.

use serde::{Deserialize, Serialize};

use crate::core::drift::{Drift, PARAMETERS};
use crate::model::ModelId;

/// The adaptation after one tick.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct AdaptationReport {
    /// The model whose drift it is; `None` before there is one.
    pub model: Option<ModelId>,
    /// How the drift is found.
    pub method: Method,
    /// From the frames of the camera.
    pub estimate: Drift,
    /// Standard deviations of the estimate, in the order of [`super::Parameter::ALL`].
    pub deviations: [f64; PARAMETERS],
    /// What is applied. The slow state is part of the zero.
    pub applied: Drift,
    /// Share of the budget that every parameter of the estimate uses.
    pub budget_used: [f64; PARAMETERS],
    /// Share of the total budget, at the corners of the hull.
    pub total_used: f64,
    /// Whether the motion shows a parameter.
    pub excited: [bool; PARAMETERS],
    /// Why nothing is learned.
    pub pauses: Pauses,
    /// Frames since the start.
    pub frames: FrameCounts,
    /// Root mean square distance between camera and calibrated model in the last window, rad.
    pub calibrated_error: f64,
    /// The same of the adapted model.
    pub adapted_error: f64,
    /// Number of times that the correction was taken back.
    pub taken_back: u32,
}

/// How the drift is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Method {
    /// Not at all: no model, or its outputs are no angles, or not as many as motors.
    #[default]
    None,
    /// Zero, gain, gap and latency, by a Kalman filter.
    Filter,
    /// The zero alone, by a slow integral: the family has no gaps that could be scaled.
    Integral,
}

/// A reason to learn nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u32)]
pub enum Pause {
    /// The robot follows no goal, or the clutch is open.
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
    CameraDisbelieved = 32,
    /// The budget is used up: calibrate.
    BudgetUsed = 64,
    /// The adapted model was worse than the calibration, and was taken back.
    TakenBack = 128,
    /// Too little motion.
    NoMotion = 256,
    /// The zero has slipped twice since the robot was off: something else than the snake moves.
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
        Self::CameraDisbelieved,
        Self::BudgetUsed,
        Self::TakenBack,
        Self::NoMotion,
        Self::SlippedAgain,
    ];

    /// In words.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::NotFollowing => "no goal is followed",
            Self::Settling => "settling for 2 s",
            Self::MemoryUnknown => "memory unknown",
            Self::OutsideHull => "outside of the hull",
            Self::NoCamera => "no camera",
            Self::CameraDisbelieved => "most frames are refused",
            Self::BudgetUsed => "budget used up: calibrate",
            Self::TakenBack => "correction taken back",
            Self::NoMotion => "too little motion",
            Self::SlippedAgain => "the zero slipped twice: look at camera and wires, switch off",
        }
    }
}

/// Reasons to learn nothing, as bits of [`Pause`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Pauses(pub u32);

impl Pauses {
    /// Learning.
    pub const NONE: Self = Self(0);

    /// With one more reason, if it holds.
    #[must_use]
    pub fn with(self, pause: Pause, holds: bool) -> Self {
        Self(self.0 | if holds { pause as u32 } else { 0 })
    }

    /// The frames of this moment do not show the drift. A lack of motion is found by frames and
    /// ended by them, and so is doubt in the camera; what is applied goes on being judged when
    /// nothing more is learned.
    pub(super) fn look_away(self) -> bool {
        [Pause::NotFollowing, Pause::Settling, Pause::MemoryUnknown, Pause::OutsideHull]
            .into_iter()
            .any(|pause| self.contains(pause))
    }

    /// Whether a reason holds.
    #[must_use]
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
    /// Learned from.
    pub used: u64,
    /// Too far from what was expected.
    pub refused: u64,
    /// In order, while nothing was learned.
    pub paused: u64,
    /// Of the same stamp as the one before.
    pub duplicate: u64,
    /// Older than one before.
    pub out_of_order: u64,
    /// Stamped later than now.
    pub future: u64,
    /// Older than the ring of regressors.
    pub too_old: u64,
    /// Less than 10 ms after the one before.
    pub too_frequent: u64,
    /// Not finite, of another number of outputs, or of poor quality.
    pub bad: u64,
}
