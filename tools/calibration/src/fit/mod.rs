//! The fit of all families to a recording, and the choice among them.
//!
//! | file | contents |
//! |---|---|
//! | `options` | options of a fit |
//! | `family` | names of the families, and the choice among them |
//! | `split` | training and held-out rows |
//! | `metrics` | errors of predictions, and rows that a robot cannot reach with the model |
//! | `flatness` | models that are flat where the robot is not |
//! | [`model_mismatch`] | evidence for a larger error than the model states |
//! | `late_camera` | latency of a camera's stamps |
//! | `slow_error` | the part of the error that a camera can follow |
//! | `model_file` | model files with their metrics |
//! | [`network`] | networks that were trained elsewhere |
//! | `network_error` | why such a network is refused |
//! | `one_family` | the fit of each family |
//! | `all_families` | the whole fit, and the choice |
//! | `earlier` | an earlier calibration as one more start |
//! | `evidence` | rows for judging families |
//! | [`choice`] | scores of the families: errors held out, and tracking on other families |
//! | `outcome` | models and the report of the fit |
//! | `error` | errors of a fit |

mod all_families;
pub mod choice;
mod earlier;
pub mod error;
mod evidence;
pub mod family;
pub mod flatness;
mod late_camera;
pub mod metrics;
mod model_file;
pub mod model_mismatch;
pub mod network;
pub mod network_error;
mod one_family;
pub mod options;
pub mod outcome;
pub(crate) mod slow_error;
pub mod split;
#[cfg(test)]
mod tests;

pub use all_families::fit;
pub use error::FitError;
pub use family::{Choice, Family};
pub use options::{Components, FitOptions};
pub use outcome::FitOutcome;
