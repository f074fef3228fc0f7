//! A new model from a calibration and what was recorded in use since.
//!
//! A calibration covers the whole range; a trial stays where the work is, and there a camera has
//! seen the snake too. Both are fitted together: the model gets better where it is used, and what
//! the trial does not show stays as the calibration has it.

use i2ris::model::Model;

use super::estimate::length;
use super::regressors::points;
use crate::fit::{FitError, FitOptions, FitOutcome, fit};
use crate::progress::Progress;
use crate::recording::{MIN_ROWS, Recording};

/// Of the use, what is held out at its end to see whether the refinement helps there.
const HELD_OUT: f64 = 0.25;

/// A mean error of the old model in use above this, deg (mm), and above [`ZERO_SHARE`] of its RMS
/// error there, is another zero and not hysteresis, which has two signs.
const ZERO: f64 = 0.5;
const ZERO_SHARE: f64 = 0.8;

/// A new model.
#[derive(Debug)]
pub struct Refined {
    /// Fitted to all rows of both recordings.
    pub outcome: FitOutcome,
    /// RMS length of the error of the old model and of one that has not seen the end of the use,
    /// there.
    pub held_out: [f64; 2],
}

/// Why there is none.
#[derive(Debug, thiserror::Error)]
pub enum RefineError {
    /// Not enough of it.
    #[error("{rows} frames in use are too few, {MIN_ROWS} are needed; record a minute of motion")]
    Short {
        /// Rows of the use.
        rows: usize,
    },
    /// The counts of the use have another zero.
    #[error(
        "the model is {0:.2} off in the mean over the use: that is another zero, not hysteresis. \
         Was the robot homed anew? Home it where it was calibrated, or calibrate anew"
    )]
    Zero(f64),
    /// The fit refuses the data.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// It would not be better.
    #[error(
        "with the first part of the use the model is no better on the rest of it: {old:.3} before, \
         {new:.3} after; the old model stays"
    )]
    NoBetter {
        /// RMS length of the error of the old model.
        old: f64,
        /// Of the new one.
        new: f64,
    },
}

/// Fits a model to a calibration and the use after it: `both` has the rows of the calibration, then
/// `in_use` rows of the use ([`Recording::followed_by`]). Lengths are in the unit of the recording.
///
/// # Errors
///
/// [`RefineError`].
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
