//! The fit of play operators: family `gmr-play`.
//!
//! 1. **Thresholds** are in geometric steps from the smallest gap that a motor step can show to the
//!    longest travel between two turning points. Their number and range are chosen by leaving out
//!    contiguous blocks.
//! 2. **Weights** are fitted by variable projection with a polynomial, a substitute for the later
//!    regression, then with a Gaussian mixture while that lowers the error on blocks left out.
//! 3. The **chain** after the operator is fitted: mixture on virtual counts, residual on lags.
//!
//! | file | contents |
//! |---|---|
//! | `thresholds` | thresholds, and the choice of their number and range |
//! | `weights` | the plays at every sample; their weights by variable projection |
//! | [`play_fit`] | the whole fit, with weights for a mixture; properties of the mechanism |

pub mod play_fit;
#[cfg(test)]
mod tests;
mod thresholds;
mod weights;
