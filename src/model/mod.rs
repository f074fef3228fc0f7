//! Forward model and inverse: encoder counts to angles and back.
//!
//! # Terms
//!
//! - **motor space**: encoder counts of one or two motors. The model treats counts as real numbers.
//! - **output space**: one to three outputs, pitch and yaw in radians or the tip position in
//!   metres.
//! - **memory**: the state of the hysteresis operators. Families without hysteresis have none.
//! - **hull**: the region of motor space that calibration visited. No model commands counts outside
//!   it.
//! - **one count's worth**: the distance that one count of the more effective motor moves the
//!   outputs at a pose.
//!
//! # Layers
//!
//! A module imports only from modules below it in this table.
//!
//! | file | contents |
//! |---|---|
//! | `prepared` | [`Model`]: a checked and prepared model file, for the control loop |
//! | `examination` | whether the inverse follows the model itself, before it moves motors |
//! | `file` | model files: format, checks, reading and writing, identity |
//! | `families` | linear, mixtures, [`hysteresis`], [`network`]; memory |
//! | `examination_path` | a path of the motors on which models are tried |
//! | `maths` | Gaussian mixture, its regression, convex hull, damped Newton inverse |
//! | `history` | past motor positions; they rebuild a memory |
//! | [`kinematic`] | where the tip of a bent snake is |
//! | `estimate`, `error`, `schema_version` | results and their units, errors, version |

mod error;
mod estimate;
mod examination;
mod examination_path;
mod families;
pub mod file;
mod history;
pub mod kinematic;
mod maths;
mod prepared;
mod schema_version;

pub use crate::robot::ModelId;
pub use error::ModelError;
pub use estimate::{Estimate, Inverse, JacobianMatrix, MemoryTerms, OutputMatrix, Query};
pub use examination::Examination;
#[cfg(feature = "controller")]
pub use examination_path::ExaminationPath;
pub use families::memory::Memory;
#[cfg(feature = "controller")]
pub use families::memory::Wear;
pub(crate) use families::runtime::Reach;
#[cfg(feature = "controller")]
pub use families::{hysteresis, network};
pub use history::History;
#[cfg(feature = "controller")]
pub use maths::gaussian_mixture::MAX_COMPONENTS;
pub use maths::hull::Hull;
#[cfg(feature = "controller")]
pub use maths::hull::{MAX_CORNERS, TOLERANCE_COUNTS};
#[cfg(feature = "controller")]
pub use maths::mixture_regression::MixtureRegression;
#[cfg(feature = "controller")]
pub use maths::{Local, polynomial_regression};
pub use prepared::Model;
