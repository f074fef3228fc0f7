//! What a model answers, in arrays of fixed size.

use serde::{Deserialize, Serialize};

use crate::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec, OutputVec};

/// Symmetric matrix over the outputs, rad^2 (m^2). Entries beyond the model's number of outputs are
/// 0.
pub type OutputMatrix = [[f64; MAX_OUTPUTS]; MAX_OUTPUTS];

/// Row: output, column: motor; rad (m) per count. Entries beyond the model's sizes are 0.
pub type JacobianMatrix = [[f64; MAX_MOTORS]; MAX_OUTPUTS];

/// Forward prediction: what the outputs are at given counts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Estimate {
    /// Expected outputs, rad (m).
    pub mean: OutputVec,
    /// Covariance of the outputs by the law of total covariance: the one to act on.
    pub covariance: OutputMatrix,
    /// Sum of squared responsibility times conditional covariance: the approximation of the
    /// calibration note. It leaves out how far the components disagree, so it is never above
    /// `covariance`.
    pub covariance_within: OutputMatrix,
}

impl Estimate {
    /// Standard deviation of every output, rad (m), from [`Estimate::covariance`].
    #[must_use]
    pub fn deviation(&self) -> OutputVec {
        std::array::from_fn(|i| {
            self.covariance
                .get(i)
                .and_then(|row| row.get(i))
                .map_or(0.0, |v| v.max(0.0).sqrt())
        })
    }
}

/// Inverse: the counts that bring the outputs to a goal.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Inverse {
    /// Counts inside the hull, always finite.
    pub counts: MotorVec,
    /// The goal cannot be reached inside the hull, or was not finite; `counts` is the nearest that
    /// can, or where the search was asked to start.
    pub clipped: bool,
    /// Distance in output space between the goal and what `counts` reach, rad (m). Goals beyond
    /// 1000 are taken as 1000; infinite if the goal was not finite.
    pub residual: f64,
    /// Model evaluations after the first one, over both starts.
    pub iterations: u32,
    /// The answer comes from the second start, the conditional mean of the counts given the goal.
    pub fell_back: bool,
}

/// How to search for an inverse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Query {
    /// Where the search starts: best the answer of the tick before.
    pub start: MotorVec,
    /// What to take for [`super::Model::correction`], rad (m): filtered, or the motors chatter.
    /// `None`: as it is.
    pub correction: Option<OutputVec>,
    /// Share of gaps and friction that is compensated, 0 to 1.
    pub compensation: f64,
}

impl Query {
    /// Full compensation with the correction as it is.
    #[must_use]
    pub const fn new(start: MotorVec) -> Self {
        Self {
            start,
            correction: None,
            compensation: 1.0,
        }
    }
}
