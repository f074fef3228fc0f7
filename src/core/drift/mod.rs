//! The drift of a calibration, and the correction for it.
//!
//! `geometry`: what the model says about its directions and gaps. `correction`: the part of a drift
//! that is applied to a model. `memories`: the memory as calibrated, and with larger gaps.

pub(super) mod correction;
pub(super) mod geometry;
pub(super) mod memories;

use serde::{Deserialize, Serialize};

use crate::model::Wear;

/// One value per output: only models of one or two angles are adapted.
pub(super) type Pair = [f64; 2];

/// Number of parameters.
pub const PARAMETERS: usize = 14;

/// Number of wear parameters: gap, slack and play of every motor.
pub(super) const WORN: usize = 6;

/// The drift of a robot from its calibration.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Drift {
    /// Shift of every output, rad.
    pub zero: [f64; 2],
    /// Rows: outputs, columns: outputs. The outputs bend by `gain` times themselves more than
    /// calibrated.
    pub gain: [[f64; 2]; 2],
    /// Gap growth of every motor, 0 as calibrated.
    pub gap: [f64; 2],
    /// Age of a frame beyond its stamp, s.
    pub latency_s: f64,
    /// The slow state along the direction of the model's error, rad.
    pub slow: f64,
    /// Preload that the wires of every motor have lost beyond what the gap says, as a share of half
    /// the calibrated range.
    pub slack: [f64; 2],
    /// Growth of half the play of every gear beyond that, as such a share.
    pub play: [f64; 2],
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
    /// Preload loss of a motor.
    Slack(u8),
    /// Play growth of a gear.
    Play(u8),
}

impl Parameter {
    /// All, in the order of `Drift::to_array`.
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
        Self::Slack(0),
        Self::Slack(1),
        Self::Play(0),
        Self::Play(1),
    ];

    /// The place of a gap, a slack or a play among all parameters.
    pub(super) const fn worn(index: usize) -> usize {
        if index < 2 { 6 + index } else { 8 + index }
    }
}

impl Drift {
    /// The parameters in the order of [`Parameter::ALL`].
    pub(crate) fn to_array(self) -> [f64; PARAMETERS] {
        let [[a, b], [c, d]] = self.gain;
        let ([x, y], [g, h]) = (self.zero, self.gap);
        let ([k, l], [m, n]) = (self.slack, self.play);
        [x, y, a, b, c, d, g, h, self.latency_s, self.slow, k, l, m, n]
    }

    /// The opposite of [`Drift::to_array`].
    pub(crate) fn from_array(values: [f64; PARAMETERS]) -> Self {
        let [x, y, a, b, c, d, g, h, latency_s, slow, k, l, m, n] = values;
        let (zero, gain, gap) = ([x, y], [[a, b], [c, d]], [g, h]);
        Self { zero, gain, gap, latency_s, slow, slack: [k, l], play: [m, n] }
    }

    /// How worn everything is, in the order of the memories that are more worn.
    pub(super) fn worn(&self) -> [f64; WORN] {
        let [[a, b], [c, d], [e, f]] = [self.gap, self.slack, self.play];
        [a, b, c, d, e, f]
    }

    pub(super) fn wear(&self) -> Wear {
        Wear { gap: self.gap, slack: self.slack, play: self.play }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_the_parameters_is_that_of_the_array() {
        let array = std::array::from_fn(|index| 1.0 + index as f64);
        let drift = Drift::from_array(array);
        assert_eq!(drift.to_array(), array);
        let index = |parameter| Parameter::ALL.iter().position(|p| *p == parameter).unwrap();
        assert_eq!(array[index(Parameter::Gain(1, 0))], drift.gain[1][0]);
        assert_eq!(array[index(Parameter::Gap(1))], drift.gap[1]);
        assert_eq!(array[index(Parameter::Slow)], drift.slow);
        let worn = [0, 1, 2, 3, 4, 5].map(|worn| array[Parameter::worn(worn)]);
        assert_eq!(worn, drift.worn());
    }
}
