//! Refusals and warnings of the fit of stop operators.

use std::fmt;

use i2ris::model::ModelError;

use super::structure::Structure;
use crate::quality::Finding;
use crate::regression::linear::LinearError;

/// Why stop operators could not be fitted.
#[derive(Debug, thiserror::Error)]
pub enum StopError {
    /// Options that make no sense.
    #[error("structures = {structures:?}: name at least one, of 1 to 3 segments with 1 to 5 stops")]
    Structures {
        /// As asked.
        structures: Vec<Structure>,
    },
    /// A bend that was not measured in full.
    #[error(
        "{outputs} output(s) do not show how {motors} motors bend the snake; measure at least \
         {motors}"
    )]
    FewOutputs {
        /// Of the recording.
        motors: usize,
        /// Of the recording.
        outputs: usize,
    },
    /// Not enough samples for so many parameters.
    #[error(
        "{samples} sample(s) do not determine {parameters} parameters, {least} would; record more"
    )]
    FewSamples {
        /// Samples that can be used.
        samples: usize,
        /// Parameters of the smallest operator asked for.
        parameters: usize,
        /// The least number of samples.
        least: usize,
    },
    /// A motor that hardly turns back: friction and gaps look like a shifted zero.
    #[error("{0}")]
    FewReversals(Finding),
    /// The affine model that the search starts from.
    #[error(transparent)]
    Line(#[from] LinearError),
    /// Motors that bend the snake in the same direction.
    #[error(
        "both motors bend the snake in the same direction; record motion in which they move \
         separately"
    )]
    Degenerate,
    /// The result is refused.
    #[error(transparent)]
    Refused(#[from] ModelError),
}

/// A reason to doubt a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StopWarning {
    /// Friction and gaps explain hardly more than a straight line does.
    LittleGain {
        /// Of the fit, RMS length of the error.
        rms: f64,
        /// Of a straight line.
        linear_rms: f64,
    },
}

impl fmt::Display for StopWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::LittleGain { rms, linear_rms } = self;
        write!(
            f,
            "friction and gaps leave an error of {rms:.3} where a straight line leaves \
             {linear_rms:.3}: the hysteresis of this robot is small, or this recording does not \
             show it"
        )
    }
}
