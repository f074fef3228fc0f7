//! The drift of a robot from its calibration, from a recording and a model.
//!
//! The model is right up to a few numbers: the zero of every output, a gain matrix, and the scale
//! of the gap of every motor. They are found by least squares with the calibration as prior, so
//! that a recording that does not show a number leaves it where it was:
//!
//! ```text
//! measured = predicted(gaps scaled) + zero + gain predicted + rest
//! ```
//!
//! The gap acts through the memory of the model, so its regressor is the prediction of a memory
//! with larger gaps, and the fit is repeated with the resulting scale. The rest of a model is
//! similar from row to row; deviations count only the independent rows.
//!
//! | file | contents |
//! |---|---|
//! | `estimate` | the drift and its uncertainty, by a robust fit with a prior |
//! | `refine` | whether it is time for a new calibration; a new model from recordings in use |

mod estimate;
mod refine;

pub(crate) use estimate::{DriftError, DriftEstimate, Value};
pub(crate) use refine::Verdict;
pub use refine::{RefineError, Refined, refine};
