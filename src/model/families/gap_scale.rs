//! The gap scale of a motor: a factor on the gaps of a model, which drift may change.

use crate::units::{MAX_MOTORS, MotorVec};

/// The gap scale of a calibration.
pub(in crate::model) const UNSCALED: MotorVec = [1.0; MAX_MOTORS];

/// The smallest and the largest gap scale.
const LEAST: f64 = 0.2;
const MOST: f64 = 3.0;

/// The nearest gap scale that a memory takes; as calibrated for what is no number.
pub(in crate::model) fn clamp(scale: &MotorVec) -> MotorVec {
    scale.map(|scale| if scale.is_nan() { 1.0 } else { scale.clamp(LEAST, MOST) })
}
