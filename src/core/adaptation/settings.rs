//! Settings of the adaptation, from the configuration, in SI units.

use crate::core::drift::Pair;
use crate::units::Nanos;

/// A degree, rad.
pub(super) const DEG: f64 = std::f64::consts::PI / 180.0;

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
    pub(super) fn new(plausibility_deg: f64, tick: Nanos) -> Self {
        let plausible = match plausibility_deg {
            0.0 => f64::INFINITY,
            distance => SHARE_OF_PLAUSIBILITY * distance,
        };
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

/// Length of a vector.
pub(super) fn length([x, y]: Pair) -> f64 {
    x.hypot(y)
}
