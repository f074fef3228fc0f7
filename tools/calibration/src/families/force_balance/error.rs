//! Why a balance of forces could not be fitted.

use i2ris::model::ModelError;

use crate::quality::Finding;

/// Why a balance of forces could not be fitted.
#[derive(Debug, thiserror::Error)]
pub enum BalanceError {
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
        /// Of the balance.
        parameters: usize,
        /// The least number of samples.
        least: usize,
    },
    /// A motor that holds still, but for the last count of its encoder.
    #[error(
        "motor {motor} hardly moves ({moves:.0} counts, the other one {other:.0}), so nothing \
         shows what it does; record motion of it, or leave its column out of the recording"
    )]
    HoldsStill {
        /// Counted from 0.
        motor: usize,
        /// From end to end, counts.
        moves: f64,
        /// The same of the other motor.
        other: f64,
    },
    /// A motor that hardly turns back: friction and gaps look like a shifted zero.
    #[error("{0}")]
    FewReversals(Finding),
    /// No start leads to a model.
    #[error("no balance of forces explains the recording; check its columns")]
    NoModel,
    /// The result is refused.
    #[error(transparent)]
    Refused(#[from] ModelError),
}
