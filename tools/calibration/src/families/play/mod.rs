//! The fit of play operators: family `gmr-play`.
//!
//! 1. **Thresholds** are in geometric steps between what one step of the motor still shows and the
//!    longest travel between two turning points. How many, and how far up, is chosen by leaving
//!    out contiguous blocks.
//! 2. **Weights** are fitted by variable projection behind a polynomial, a substitute for the
//!    later regression, and then behind a Gaussian mixture for as long as that lowers the error on
//!    blocks left out.
//! 3. The **chain** behind the operator is fitted: mixture on the virtual counts, residual on the
//!    lags.
//!
//! | file | contents |
//! |---|---|
//! | `thresholds` | thresholds, and the range of them that a path can show |
//! | `threshold_search` | how many thresholds, and up to where |
//! | `states` | the states of the plays at every sample |
//! | `weights` | variable projection |
//! | `alternation` | weights behind a mixture |
//! | [`play_fit`] | all of it in order |

mod alternation;
pub mod play_fit;
mod states;
#[cfg(test)]
mod tests;
mod threshold_search;
mod thresholds;
mod weights;

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
