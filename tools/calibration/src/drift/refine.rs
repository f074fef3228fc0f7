//! A new model from a calibration and later recordings in use.
//!
//! A calibration covers the whole range. A trial stays in the working range, where a camera has
//! measured the snake as well. Both are fitted together: the model improves where it is used, and
//! the rest stays as calibrated.

use i2ris::model::Model;

use super::estimate::length;
use super::regressors::points;
use crate::fit::{FitError, FitOptions, FitOutcome, fit};
use crate::progress::Progress;
use crate::recording::{MIN_ROWS, Recording};

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
    /// RMS length of the error at the end of the use: of the old model, and of one that was not
    /// fitted to this part.
    pub held_out: [f64; 2],
}

/// Why there is no new model.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RefineError {
    #[error("{rows} frames in use are too few, {MIN_ROWS} are needed; record a minute of motion")]
    Short {
        /// Rows of the use.
        rows: usize,
    },
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
    NoBetter {
        /// RMS length of the error of the old model.
        old: f64,
        /// RMS length of the error of the new model.
        new: f64,
    },
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
        return Err(RefineError::Short { rows: in_use });
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
