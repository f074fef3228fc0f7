//! Forward model and inverse: encoder counts to angles and back.
//!
//! # Words
//!
//! - **motor space**: encoder counts of one or two motors, fractional here.
//! - **output space**: one to three outputs, pitch and yaw in radians or the tip position in metres.
//! - **memory**: what the model has to remember of the past, because the angle depends on it. Families without
//!   hysteresis have an empty one.
//! - **hull**: the region of motor space that calibration visited. No model commands a count outside it.
//!
//! | file | holds |
//! |---|---|
//! | `gmm` | the Gaussian mixture: validation, prepared form |
//! | `gmr` | Gaussian mixture regression: mean, both covariances, Jacobian |
//! | `linear` | affine least squares |
//! | `hull` | convex region of motor space |
//! | `inverse` | damped Newton inside the hull |
//! | `file` | model files: schema, validation, identity |

pub mod file;

use std::fmt;

/// SHA-256 of the canonical form of a model file: the identity of a model.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct ModelId(pub [u8; 32]);

impl fmt::Display for ModelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ModelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ModelId({self})")
    }
}
