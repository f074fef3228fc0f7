//! The fit of all families to a recording, and the choice among them.
//!
//! | file | contents |
//! |---|---|
//! | `options` | options of a fit; names of the families, and the choice among them |
//! | `split` | training and held-out rows |
//! | `metrics` | errors of predictions; rows that the model does not reach, or that judge it |
//! | `flatness` | models that are flat where the robot is not |
//! | `late_camera` | latency of a camera's stamps |
//! | `model_file` | model files with their metrics, and the error that a camera can follow |
//! | [`network`] | networks that were trained elsewhere |
//! | `one_family` | the fit of each family |
//! | `all_families` | the whole fit, and the choice |
//! | `earlier` | an earlier calibration as one more start |
//! | `choice` | scores of the families: errors held out, and tracking on other families |
//! | `outcome` | models and the report of the fit, or why there is none; a larger error in use |

mod all_families;
pub(crate) mod choice;
mod earlier;
pub mod flatness;
mod late_camera;
pub mod metrics;
mod model_file;
pub mod network;
mod one_family;
mod options;
mod outcome;
pub mod split;
#[cfg(test)]
mod tests;

pub use all_families::fit;
pub use options::{Choice, Components, Family, FitOptions};
pub use outcome::FitOutcome;
pub(crate) use outcome::{FamilyOutcome, FitError, ModelMismatch};
