//! Wear: what drift may change of a memory; the gap scale of a motor is a factor on its gaps.

use serde::{Deserialize, Serialize};

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

/// How a snake differs from the calibrated one by wear, per motor; 0 as calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Wear {
    /// Growth of all lost motion, friction with it, as a share: see [`Memory::set_gap_scale`].
    ///
    /// [`Memory::set_gap_scale`]: crate::model::Memory::set_gap_scale
    pub gap: MotorVec,
    /// Preload that the wires have lost beyond that, as a share of half the calibrated range.
    pub slack: MotorVec,
    /// What half the play of the gear has grown by beyond that, as such a share: a fit may have put
    /// all of the play of a new gear into the friction, and a factor on nothing is nothing.
    pub play: MotorVec,
}
