//! The drift of a calibration, and the correction for it.
//!
//! `geometry`: what the model says about its directions and gaps. `correction`: the part of a drift
//! that is applied to a model. `memories`: the memory as calibrated, and with larger gaps.

pub(super) mod correction;
pub(super) mod geometry;
pub(super) mod memories;

use serde::{Deserialize, Serialize};

/// One value per output: only models of one or two angles are adapted.
pub(super) type Pair = [f64; 2];

/// Number of parameters.
pub const PARAMETERS: usize = 10;

/// The drift of a robot from its calibration.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Drift {
    /// Shift of every output, rad.
    pub zero: [f64; 2],
    /// Rows: outputs, columns: outputs. The outputs bend by `gain` times themselves more than
    /// calibrated.
    pub gain: [[f64; 2]; 2],
    /// Growth of the gap of every motor, 0 as calibrated.
    pub gap: [f64; 2],
    /// How much older a frame is than its stamp, s.
    pub latency_s: f64,
    /// The slow state along the direction of the model's error, rad.
    pub slow: f64,
}

/// A group of parameters that is learned, limited and shown together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Parameter {
    /// Zero of an output.
    Zero(u8),
    /// Gain of an output by an output.
    Gain(u8, u8),
    /// Gap scale of a motor.
    Gap(u8),
    /// Latency of the camera.
    Latency,
    /// The slow state.
    Slow,
}

impl Parameter {
    /// All, in the order of [`Drift::to_array`].
    pub const ALL: [Self; PARAMETERS] = [
        Self::Zero(0),
        Self::Zero(1),
        Self::Gain(0, 0),
        Self::Gain(0, 1),
        Self::Gain(1, 0),
        Self::Gain(1, 1),
        Self::Gap(0),
        Self::Gap(1),
        Self::Latency,
        Self::Slow,
    ];
}

impl Drift {
    /// The parameters in the order of [`Parameter::ALL`].
    #[must_use]
    pub fn to_array(&self) -> [f64; PARAMETERS] {
        let [[a, b], [c, d]] = self.gain;
        let ([x, y], [g, h]) = (self.zero, self.gap);
        [x, y, a, b, c, d, g, h, self.latency_s, self.slow]
    }

    /// The opposite of [`Drift::to_array`].
    #[must_use]
    pub fn from_array([x, y, a, b, c, d, g, h, latency_s, slow]: [f64; PARAMETERS]) -> Self {
        Self { zero: [x, y], gain: [[a, b], [c, d]], gap: [g, h], latency_s, slow }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_the_parameters_is_that_of_the_array() {
        let array = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0];
        let drift = Drift::from_array(array);
        assert_eq!(drift.to_array(), array);
        let index = |parameter| Parameter::ALL.iter().position(|p| *p == parameter).unwrap();
        assert_eq!(array[index(Parameter::Gain(1, 0))], drift.gain[1][0]);
        assert_eq!(array[index(Parameter::Gap(1))], drift.gap[1]);
        assert_eq!(array[index(Parameter::Slow)], drift.slow);
    }
}
