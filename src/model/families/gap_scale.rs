//! Wear: what drift may change of a memory; the gap scale of a motor is a factor on its gaps.

use serde::{Deserialize, Serialize};

use crate::units::{MAX_MOTORS, MotorVec};

/// The gap scale of a calibration.
pub(in crate::model) const UNSCALED: MotorVec = [1.0; MAX_MOTORS];

/// Limits of the gap scale.
const MIN_SCALE: f64 = 0.2;
const MAX_SCALE: f64 = 3.0;

/// The nearest gap scale that a memory accepts; the calibrated one for NaN.
pub(in crate::model) fn clamp(scale: &MotorVec) -> MotorVec {
    scale.map(|scale| if scale.is_nan() { 1.0 } else { scale.clamp(MIN_SCALE, MAX_SCALE) })
}

/// How a snake differs from the calibrated one by wear, per motor; 0 as calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Wear {
    /// Growth of all lost motion, friction with it, as a share: see [`Memory::set_gap_scale`].
    ///
    /// [`Memory::set_gap_scale`]: crate::model::Memory::set_gap_scale
    pub gap: MotorVec,
    /// Preload that the wires have lost beyond that, as a share of half the calibrated range.
    pub slack: MotorVec,
    /// Growth of half the gear's play beyond that factor, as such a share: a fit may have put all
    /// the play of a new gear into the friction, and a factor on zero remains zero.
    pub play: MotorVec,
}
