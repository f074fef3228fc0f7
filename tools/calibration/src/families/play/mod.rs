//! The fit of play operators: family `gmr-play`.
//!
//! 1. **Thresholds** are in geometric steps from the smallest gap that a motor step can show to the
//!    longest travel between two turning points. Their number and range are chosen by leaving out
//!    contiguous blocks.
//! 2. **Weights** are fitted by variable projection with a polynomial, a substitute for the later
//!    regression, and then with a Gaussian mixture as long as that lowers the error on blocks left
//!    out.
//! 3. The **chain** after the operator is fitted: mixture on the virtual counts, residual on the
//!    lags.
//!
//! | file | contents |
//! |---|---|
//! | `thresholds` | thresholds, and the range of them that a path can show |
//! | `threshold_search` | number and range of the thresholds |
//! | `states` | the states of the plays at every sample |
//! | `weights` | variable projection |
//! | `alternation` | weights for a mixture |
//! | [`play_fit`] | the whole fit |

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
#[allow(missing_docs, reason = "the messages say it")]
pub enum PlayError {
    #[error("{0} sample(s) do not determine play operators, {1} might; record more")]
    TooFewSamples(usize, usize),
    /// A motor, counted from 0, that hardly moves.
    #[error(
        "motor {0} hardly moves in the rows used for training; move that motor, or hold out \
         other rows"
    )]
    Still(usize),
    #[error(
        "the outputs cannot be regressed on the plays: numbers are too large, or there are too \
         few samples"
    )]
    Degenerate,
    #[error(transparent)]
    Refused(#[from] ModelError),
    #[error(transparent)]
    Linear(#[from] LinearError),
    #[error(transparent)]
    Chain(#[from] ChainError),
}
