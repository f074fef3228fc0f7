//! Correction: the part of a drift that is applied to a model.

use serde::{Deserialize, Serialize};

use super::geometry::{inverse, pair, product};
use super::{Drift, Pair};
use crate::model::Wear;
use crate::units::OutputVec;

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

    /// The correction as a drift.
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
