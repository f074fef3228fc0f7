//! The drift of a calibration, the correction for it, and the memories that show it.
//!
//! `geometry`: the directions and gaps of a model.

pub(super) mod geometry;

use serde::{Deserialize, Serialize};

use crate::model::{Memory, Model, Wear};
use crate::units::{MotorVec, OutputVec};
use geometry::{inverse, pair, product, subtract};

/// One value per output: only models of one or two angles are adapted.
pub(super) type Pair = [f64; 2];

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
    Latency,
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

/// Correction of a model: `adapted = gapped + zero + gain gapped`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(in crate::core) struct Correction {
    /// rad.
    pub zero: Pair,
    pub gain: [Pair; 2],
    pub wear: Wear,
}

impl Correction {
    /// The adapted pose.
    pub(crate) fn apply(&self, gapped: &OutputVec) -> OutputVec {
        let at = pair(gapped);
        let bent = product(&self.gain, at);
        let mut adapted = *gapped;
        for (index, adapted) in adapted.iter_mut().enumerate().take(2) {
            *adapted = at[index] + self.zero[index] + bent[index];
        }
        adapted
    }

    /// The gapped pose whose adapted pose is the goal.
    pub(crate) fn undo(&self, goal: &OutputVec) -> OutputVec {
        self.calibrated_view().pose(goal)
    }

    /// How the pose without the correction follows from the adapted one.
    pub(crate) fn calibrated_view(&self) -> CalibratedView {
        let [[a, b], [c, d]] = self.gain;
        // The budget keeps the gain far from -1.
        let inverse = inverse(&[[1.0 + a, b], [c, 1.0 + d]]).unwrap_or([[1.0, 0.0], [0.0, 1.0]]);
        CalibratedView { inverse, zero: self.zero }
    }

    pub(crate) fn drift(&self) -> Drift {
        Drift {
            zero: self.zero,
            gain: self.gain,
            gap: self.wear.gap,
            slack: self.wear.slack,
            play: self.wear.play,
            ..Drift::default()
        }
    }
}

/// How the pose as calibrated follows from an adapted one: `inverse (pose - zero)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CalibratedView {
    pub inverse: [[f64; 2]; 2],
    /// rad.
    pub zero: [f64; 2],
}

impl CalibratedView {
    pub(crate) fn pose(&self, pose: &OutputVec) -> OutputVec {
        let [x, y] = product(&self.inverse, [pose[0] - self.zero[0], pose[1] - self.zero[1]]);
        [x, y, pose[2]]
    }

    /// Converts a slope by the calibrated pose to one by the adapted pose.
    pub(crate) fn slope(&self, slope: &OutputVec) -> OutputVec {
        let [[a, b], [c, d]] = self.inverse;
        [a * slope[0] + c * slope[1], b * slope[0] + d * slope[1], slope[2]]
    }
}

/// How much more worn a shadow is: its gap scale, its slack, or its play.
const MORE: [f64; 3] = [0.1, 0.002, 0.001];

/// Memories that follow the same positions as the one of the model in use.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(in crate::core) struct DriftMemories {
    pub calibrated: Memory,
    /// One per motor, whose gap is wider; then more slack; then more play.
    shadows: [Memory; WORN],
}

impl DriftMemories {
    /// Copies of a new model's memory.
    pub(crate) fn new(memory: &Memory) -> Self {
        Self { calibrated: *memory, shadows: [*memory; WORN] }
    }

    /// Moves on to a position, some time after the one before, s. `wear` is the one in use.
    pub(crate) fn advance(
        &mut self,
        model: &Model,
        (position, time_s): (&MotorVec, f64),
        wear: &Wear,
    ) {
        model.advance_over(&mut self.calibrated, position, time_s);
        let has_wires = self.calibrated.has_wires();
        for (index, shadow) in self.shadows.iter_mut().enumerate() {
            if is_worn(index, model, has_wires) {
                let mut more = [wear.gap, wear.slack, wear.play];
                more[index / 2][index % 2] += MORE[index / 2];
                let [gap, slack, play] = more;
                shadow.set_wear(&Wear { gap, slack, play });
                model.advance_over(shadow, position, time_s);
            }
        }
    }

    pub(crate) fn calibrated_pose(&self, model: &Model, position: &MotorVec) -> Pair {
        pair(&model.predict(position, &self.calibrated).mean)
    }

    /// The change of the pose per growth of what wears, in the order of the shadows.
    pub(crate) fn slopes(&self, model: &Model, position: &MotorVec, gapped: Pair) -> [Pair; WORN] {
        let mut slopes = [Pair::default(); WORN];
        let has_wires = self.calibrated.has_wires();
        for (index, (slope, shadow)) in slopes.iter_mut().zip(&self.shadows).enumerate() {
            if is_worn(index, model, has_wires) {
                let worn = pair(&model.predict(position, shadow).mean);
                *slope = subtract(worn, gapped).map(|change| change / MORE[index / 2]);
            }
        }
        slopes
    }
}

fn is_worn(index: usize, model: &Model, has_wires: bool) -> bool {
    index % 2 < model.motors() && (index < 2 || has_wires)
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
