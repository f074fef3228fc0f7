//! Why plays could not be fitted.

use i2ris::model::ModelError;

use super::chain::ChainError;
use crate::regression::linear::LinearError;

/// Why no plays could be fitted.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// Not enough samples given, and the number needed.
    #[error("{0} sample(s) do not determine play operators, {1} might; record more")]
    TooFewSamples(usize, usize),
    /// A motor, counted from 0, that hardly moves.
    #[error(
        "motor {0} hardly moves in the rows used for training; record motion of it, or hold out \
         other rows"
    )]
    Still(usize),
    /// Outputs that cannot be regressed on the counts.
    #[error(
        "the outputs cannot be regressed on the plays: numbers are too large, or there are too \
         few samples"
    )]
    Degenerate,
    /// The operator is refused.
    #[error(transparent)]
    Refused(#[from] ModelError),
    /// Virtual counts that move as one.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// Nothing could be fitted behind the operator.
    #[error(transparent)]
    Chain(#[from] ChainError),
}
