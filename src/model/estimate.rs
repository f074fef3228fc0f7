//! Results of a model, in arrays of fixed size, and their units.

use std::f64::consts::PI;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec, OutputVec};

/// Symmetric matrix over the outputs, rad^2 (m^2); 0 for outputs that the model lacks.
pub type OutputMatrix = [[f64; MAX_OUTPUTS]; MAX_OUTPUTS];

/// Row: output, column: motor; rad (m) per count. Entries beyond the model's sizes are 0.
pub type JacobianMatrix = [[f64; MAX_MOTORS]; MAX_OUTPUTS];

/// Standard deviation of a prediction beyond the hull, as a share of the way beyond. Twice that
/// covered nine of ten predictions on nine of ten simulated snakes, of 11 physics.
const EXTRAPOLATED: f64 = 0.12;

/// Forward prediction: the outputs at given counts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Estimate {
    /// Expected outputs, rad (m).
    pub mean: OutputVec,
    /// Covariance of the outputs: that of the family, plus the uncertainty beyond the hull.
    pub covariance: OutputMatrix,
}

impl Estimate {
    /// Standard deviation of every output, rad (m), from [`Estimate::covariance`].
    #[must_use]
    pub fn deviation(&self) -> OutputVec {
        std::array::from_fn(|i| {
            self.covariance.get(i).and_then(|row| row.get(i)).map_or(0.0, |v| v.max(0.0).sqrt())
        })
    }

    /// Adds the uncertainty at a position that is `beyond` counts outside the hull, where the
    /// outputs change by `slope` per count.
    pub(in crate::model) fn extrapolate(&mut self, beyond: &MotorVec, slope: &JacobianMatrix) {
        for (output, (line, slope)) in self.covariance.iter_mut().zip(slope).enumerate() {
            let ways = beyond.iter().zip(slope).map(|(counts, slope)| counts * slope);
            let square: f64 = ways.map(|way| way * way).sum();
            line[output] += EXTRAPOLATED * EXTRAPOLATED * square;
        }
    }
}

/// Terms that depend on the memory alone, computed once and used in several predictions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MemoryTerms {
    /// See [`super::Model::correction`], rad (m).
    pub correction: OutputVec,
    /// The virtual counts at the position of the memory. Families without virtual counts do not
    /// use them.
    pub virtual_counts: MotorVec,
}

/// Inverse: the counts that bring the outputs to a goal.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Inverse {
    /// Counts inside the hull, always finite.
    pub counts: MotorVec,
    /// The goal cannot be reached inside the hull, or is not finite. `counts` is then the nearest
    /// reachable position, or the start of the search for a goal that is not finite.
    pub clipped: bool,
    /// Nearest goal within the calibration, rad (m), whatever the past motion: the requested one
    /// if it is not clipped. Past motion may keep `counts` short of it.
    pub reached: OutputVec,
    /// Distance in output space between the goal and the pose at `counts`, rad (m). Goals are
    /// clamped to 1000. The residual is infinite if the goal is not finite.
    pub residual: f64,
    /// Model evaluations after the first one, over both starts.
    pub iterations: u32,
    /// The result comes from the second start, the conditional mean of the counts given the goal.
    pub fell_back: bool,
}

/// Options of the search for an inverse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Query {
    /// Start of the search. The result of the previous tick is the best choice.
    pub start: MotorVec,
    /// Replaces [`super::Model::correction`], rad (m). It must be filtered, or the motors chatter.
    /// `None` uses the correction of the model.
    pub correction: Option<OutputVec>,
    /// Compensated share of backlash and friction, 0 to 1.
    pub compensation: f64,
}

impl Query {
    /// Full compensation with the correction of the model.
    #[must_use]
    pub const fn new(start: MotorVec) -> Self {
        Self { start, correction: None, compensation: 1.0 }
    }
}

/// Unit of an output in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutputUnit {
    /// Degrees; radians in code.
    Deg,
    /// Millimetres; metres in code.
    Mm,
}

impl OutputUnit {
    /// One of this unit in radians or metres.
    #[must_use]
    pub const fn si(self) -> f64 {
        match self {
            Self::Deg => PI / 180.0,
            Self::Mm => 1e-3,
        }
    }
}

impl fmt::Display for OutputUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Deg => "deg",
            Self::Mm => "mm",
        })
    }
}
