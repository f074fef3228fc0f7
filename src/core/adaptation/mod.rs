//! Adaptation: the drift of a calibration, followed by the camera, inside fences (H20 to H23).
//!
//! A calibration ages: zeros slip, gaps grow, the bend per count changes. The camera shows it, some
//! hundredths of a second late. Drift takes minutes, so a late frame is acceptable: recent poses
//! are kept, and a frame is compared with the pose of its own time.
//!
//! # Terms
//!
//! - **drift**: zero of both outputs, a gain matrix, the gap scale of every motor, for wires with a
//!   preload also slack and play ([`Wear`](crate::model::Wear)), the latency of the camera, and one
//!   slow state along the direction in which the model errs.
//! - **calibrated, gapped, adapted pose**: of the model as calibrated; with scaled gaps; with all
//!   of the correction. `adapted = gapped + zero + gain gapped`.
//! - **estimate**: drift estimated by a Kalman filter. **Correction**: the part of the estimate
//!   that is applied to the inverse and to `measured_js`.
//! - **shadow**: a memory that is a little more worn in one respect. Its distance from the memory
//!   in use is the regressor.
//! - **excitation**: motion that shows a parameter. Without it the parameter is not learned.
//!   Parameters that motion cannot distinguish are moved together by the filter covariance.
//! - **budget**: the largest drift that is followed, per parameter and in total.
//!
//! # Fences
//!
//! 1. `budget`: at a confirmed 100 %, not a swing of the filter, learning stops: recalibrate. Wear
//!    counts towards the total by its observed effect.
//! 2. Conditions in `fences`: only while goals are followed, inside the hull, with a known memory
//!    and good frames; not within 2 s of a fault, a swap, a conditioning cycle or a command.
//! 3. `excitation`: per parameter.
//! 4. Score in `fences`: adapted against calibrated on the same frames; three worse windows of 10 s
//!    revert the correction.
//! 5. `moving_correction`: moves with the goal only, along its direction, no faster than a limit.
//! 6. Nothing is written over a calibration: the correction ends with the controller.
//! 7. `plausibility` also compares the camera with the calibrated pose.
//! 8. Scatter in `frames`: noisy frames have a low weight, whatever the configuration says.
//! 9. What a push of tissue can do is bounded by the budget: only small slips are followed, and one
//!    of them until the robot has been disabled.
//!
//! A family without gaps has no regressor for them. Its zero follows the error of the camera by a
//! slow integral instead, never both.
//!
//! Sources: R. E. Kalman 1960; scalar updates: G. J. Bierman 1977; parameters without excitation
//! are considered, not updated: S. F. Schmidt 1966. The limit of the integral, `k T < 1/e`, is that
//! of an integrator with a delay without overshoot.

mod budget;
mod estimator;
mod excitation;
mod fences;
mod frames;
mod moving_correction;
mod step;

use serde::{Deserialize, Serialize};

use crate::core::drift::Pair;
pub use crate::core::drift::{Drift, PARAMETERS, Parameter};
pub use crate::core::events::AdaptationEvent;
use crate::model::ModelId;
use crate::units::Nanos;
pub(super) use step::{Adaptation, AdaptationState, Surroundings};

/// A degree, rad.
const DEG: f64 = std::f64::consts::PI / 180.0;

/// Budget of the zero, of both angles together: a view that creeps leads the tip no further.
const ZERO_BUDGET_DEG: f64 = 1.5;
/// Budget of every entry of the gain matrix, as a share of the calibrated gain.
const GAIN_BUDGET: f64 = 0.2;
/// Budget of the gap growth of every motor, as a share of the calibrated gap. A gap may shrink by
/// half as much.
const GAP_BUDGET: f64 = 0.6;
/// Budget of the preload that the wires lose beyond that, as a share of half the calibrated range.
const SLACK_BUDGET: f64 = 0.03;
/// Budget of the play that the gears gain beyond that, as such a share.
const PLAY_BUDGET: f64 = 0.02;
/// Budget of the camera latency beyond its stamps.
const LATENCY_BUDGET_S: f64 = 0.06;
/// Budget of all together: how far the correction may move the tip anywhere in the calibrated hull.
const TOTAL_BUDGET_DEG: f64 = 4.8;
/// It is below the distance at which camera and model are not plausible by this factor: adaptation
/// alone must not cause a fault.
const SHARE_OF_PLAUSIBILITY: f64 = 0.96;
/// Fastest motion of the tip by the correction while a goal moves. A goal at rest is never moved.
const SLEW_DEG_S: f64 = 1.0;
/// The largest step of the zero that is taken to be a slip. A larger one is taken to be a push from
/// outside and not followed.
const LARGEST_STEP_DEG: f64 = 1.5;
/// Standard deviation of the best camera's angles; frames that scatter more count less.
const CAMERA_DEVIATION_DEG: f64 = 0.07;
/// Frames with a quality below this are not used. Cameras that give none are used.
const MIN_QUALITY: f64 = 0.3;

/// Settings that do not change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::core) struct Settings {
    /// rad.
    pub zero_budget: f64,
    pub gain_budget: f64,
    pub gap_budget: f64,
    pub slack_budget: f64,
    pub play_budget: f64,
    pub latency_budget_s: f64,
    /// rad.
    pub total_budget: f64,
    /// rad/s.
    pub slew: f64,
    /// Deviation of the camera, rad.
    pub camera: f64,
    /// rad.
    pub largest_step: f64,
    pub least_quality: f64,
    pub tick_s: f64,
}

impl Settings {
    /// `plausibility_deg`: 0 if camera and model are not compared.
    fn new(plausibility_deg: f64, tick: Nanos) -> Self {
        let is_off = plausibility_deg == 0.0;
        let plausible =
            if is_off { f64::INFINITY } else { SHARE_OF_PLAUSIBILITY * plausibility_deg };
        Self {
            zero_budget: ZERO_BUDGET_DEG.to_radians(),
            gain_budget: GAIN_BUDGET,
            gap_budget: GAP_BUDGET,
            slack_budget: SLACK_BUDGET,
            play_budget: PLAY_BUDGET,
            latency_budget_s: LATENCY_BUDGET_S,
            total_budget: TOTAL_BUDGET_DEG.min(plausible).to_radians(),
            slew: SLEW_DEG_S.to_radians(),
            camera: CAMERA_DEVIATION_DEG.to_radians(),
            largest_step: LARGEST_STEP_DEG.to_radians(),
            least_quality: MIN_QUALITY,
            tick_s: tick.as_seconds(),
        }
    }
}

fn length([x, y]: Pair) -> f64 {
    x.hypot(y)
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct AdaptationReport {
    /// The model that drifts; `None` without a model.
    pub model: Option<ModelId>,
    pub method: Method,
    pub estimate: Drift,
    /// Standard deviations of the estimate, in the order of [`Parameter::ALL`].
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
    pub frames: FrameCounts,
    /// Root mean square distance between camera and calibrated model in the last window, rad.
    pub calibrated_error: f64,
    /// The same for the adapted model.
    pub adapted_error: f64,
    /// Number of times that the correction was reverted.
    pub taken_back: u32,
}

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
    MemoryUnknown = 4,
    OutsideHull = 8,
    /// No frame arrives.
    NoCamera = 16,
    /// Most frames are refused: a wrong camera, or a push from outside.
    CameraRejected = 32,
    /// The budget is used up: calibrate.
    BudgetUsed = 64,
    /// The adapted model was worse than the calibrated model and was reverted.
    Reverted = 128,
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

    pub fn with(self, pause: Pause, holds: bool) -> Self {
        Self(self.0 | if holds { pause as u32 } else { 0 })
    }

    /// Whether present frames do not show the drift. Lack of motion and a rejected camera are
    /// detected and ended by frames, so they do not count here; the applied correction is scored
    /// even when learning has stopped.
    fn look_away(self) -> bool {
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
