//! Whether it is time for a new calibration, and a new model from recordings in use.
//!
//! A calibration covers the whole range, a trial the working range. Both are fitted together: the
//! model improves where it is used, and the rest stays as calibrated.

use std::fmt;

use i2ris::model::Model;
use i2ris::model::file::OutputMetrics;
use serde::Serialize;

use super::estimate::{DriftEstimate, Value, length, points};
use crate::fit::{FitError, FitOptions, FitOutcome, fit};
use crate::progress::Progress;
use crate::recording::{MIN_ROWS, Recording};

/// An effect of the drift below this is negligible, deg (mm).
const NOTHING: f64 = 0.05;

/// A rest this many times that of its calibration: the model no longer fits the robot.
const WORSE: f64 = 1.5;

/// A number differs from its calibration beyond this many deviations.
const SIGNIFICANT: f64 = 3.0;

/// Limits of a drift; beyond, no shape is trusted: zero, deg (mm); gain; growth and loss of a gap.
const FAR: [f64; 4] = [3.0, 0.2, 0.6, 0.3];

/// Recommended action.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The calibration holds.
    Good,
    /// It has drifted, and a minute of motion refines it.
    Refine,
    /// More than a drift, or too much of it.
    Calibrate,
}

impl Verdict {
    /// The verdict on a model with its drift.
    pub fn new(model: &Model, drift: &DriftEstimate) -> Self {
        let [before, after] = drift.rms;
        let usual = usual(&model.file().metrics);
        if is_far(drift) || after > WORSE * usual.max(NOTHING) {
            Self::Calibrate
        } else if before - after > NOTHING && is_significant(drift) {
            Self::Refine
        } else {
            Self::Good
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Good => "the calibration holds",
            Self::Refine => {
                "it has drifted: home the robot again, or `i2ris calibrate fit` it with a trial"
            }
            Self::Calibrate => "the robot needs a new calibration",
        })
    }
}

/// Error length of a calibration on its own recording, on held-out rows if available.
fn usual(metrics: &[OutputMetrics]) -> f64 {
    let square = |metrics: &OutputMetrics| {
        let fit = metrics.held_out.unwrap_or(metrics.training);
        fit.rmsd * fit.rmsd
    };
    metrics.iter().map(square).sum::<f64>().sqrt()
}

fn is_far(drift: &DriftEstimate) -> bool {
    let [zero, gain, wider, narrower] = FAR;
    let beyond = |value: &Value, limit: f64| value.value.abs() > limit;
    drift.zero.iter().any(|it| beyond(it, zero))
        || drift.gain.iter().flatten().any(|it| beyond(it, gain))
        || drift.gap_scale.iter().any(|it| !(1.0 - narrower..=1.0 + wider).contains(&it.value))
}

fn is_significant(drift: &DriftEstimate) -> bool {
    let from = |value: &Value, calibrated: f64| {
        (value.value - calibrated).abs() > SIGNIFICANT * value.deviation
    };
    let linear = drift.zero.iter().chain(drift.gain.iter().flatten());
    linear.into_iter().any(|it| from(it, 0.0)) || drift.gap_scale.iter().any(|it| from(it, 1.0))
}

/// Share at the end of the use that is held out, to test whether the refinement helps.
const HELD_OUT: f64 = 0.25;

/// A mean error of the old model in use above this, deg (mm), and above [`ZERO_SHARE`] of its RMS
/// error there, is a shifted zero and not hysteresis, which has both signs.
const ZERO: f64 = 0.5;
const ZERO_SHARE: f64 = 0.8;

/// A new model.
#[derive(Debug)]
pub struct Refined {
    /// Fitted to all rows of both recordings.
    pub outcome: FitOutcome,
    /// RMS error length at the end of the use: old model, and one not fitted to this part.
    pub held_out: [f64; 2],
}

/// Why there is no new model.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RefineError {
    #[error("{0} frames in use are too few, {MIN_ROWS} are needed; record a minute of motion")]
    Short(usize),
    #[error(
        "mean error of the model in use is {0:.2}: the zero has shifted; this is not hysteresis. \
         If the robot was homed again, home it at the pose of the calibration, or recalibrate"
    )]
    Zero(f64),
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error(
        "fitted with the first part of the use, the model is not better on the rest: {old:.3} \
         before, {new:.3} after; the old model stays"
    )]
    NoBetter { old: f64, new: f64 },
}

/// Fits a model to a calibration and the use after it: `both` has the rows of the calibration, then
/// `in_use` rows of the use ([`Recording::followed_by`]). Lengths are in the unit of the recording.
pub fn refine(
    old: &Model,
    both: &Recording,
    in_use: usize,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<Refined, RefineError> {
    if in_use < MIN_ROWS {
        return Err(RefineError::Short(in_use));
    }
    let rows = both.rows().len();
    let errors = |model: &Model, from: usize| -> Vec<[f64; 3]> {
        points(model, both, &[1.0; 2])
            .iter()
            .filter(|point| point.row >= from)
            .map(|point| std::array::from_fn(|of| point.measured[of] - point.predicted[of]))
            .collect()
    };
    let of_use = errors(old, rows - in_use);
    let mean = |of: usize| of_use.iter().map(|error| error[of]).sum::<f64>() / in_use as f64;
    let offset = length([std::array::from_fn(mean)].into_iter());
    if offset > ZERO && offset > ZERO_SHARE * length(of_use.into_iter()) {
        return Err(RefineError::Zero(offset));
    }
    let first = rows - (HELD_OUT * in_use as f64) as usize;
    let of_first = fit(&both.first_rows(first), options, progress)?.model;
    let [old, new] = [old, &of_first].map(|model| length(errors(model, first).into_iter()));
    if new >= old {
        return Err(RefineError::NoBetter { old, new });
    }
    Ok(Refined { outcome: fit(both, options, progress)?, held_out: [old, new] })
}
