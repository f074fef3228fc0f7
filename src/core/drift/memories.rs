//! Memories beside the one in use: as calibrated, and with larger gaps.

use serde::{Deserialize, Serialize};

use super::Pair;
use super::geometry::{pair, subtract};
use crate::model::{Memory, Model};
use crate::units::{MAX_MOTORS, MotorVec};

/// How much wider the gap of a shadow is.
const SHADOW: f64 = 0.1;

/// Memories that follow the same positions as the one of the model in use.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(in crate::core) struct DriftMemories {
    calibrated: Memory,
    /// One per motor, whose gap is wider.
    shadows: [Memory; MAX_MOTORS],
}

impl DriftMemories {
    /// Copies of the memory of a model that has just taken over.
    pub fn new(memory: &Memory) -> Self {
        Self { calibrated: *memory, shadows: [*memory; MAX_MOTORS] }
    }

    /// The memory as calibrated.
    pub fn calibrated(&self) -> &Memory {
        &self.calibrated
    }

    /// Moves on to a position. `scale` is the gap scale in use.
    pub fn advance(&mut self, model: &Model, position: &MotorVec, scale: &MotorVec) {
        model.advance(&mut self.calibrated, position);
        for (motor, shadow) in self.shadows.iter_mut().enumerate().take(model.motors()) {
            let mut wider = *scale;
            if let Some(scale) = wider.get_mut(motor) {
                *scale += SHADOW;
            }
            shadow.set_gap_scale(&wider);
            model.advance(shadow, position);
        }
    }

    /// The pose as calibrated.
    pub fn calibrated_pose(&self, model: &Model, position: &MotorVec) -> Pair {
        pair(&model.predict(position, &self.calibrated).mean)
    }

    /// The change of the pose per growth of the gap of every motor.
    pub fn gap_slopes(&self, model: &Model, position: &MotorVec, gapped: Pair) -> [Pair; 2] {
        let mut slopes = [Pair::default(); MAX_MOTORS];
        let shadows = slopes.iter_mut().zip(&self.shadows);
        for (slope, shadow) in shadows.take(model.motors()) {
            let wider = pair(&model.predict(position, shadow).mean);
            *slope = subtract(wider, gapped).map(|change| change / SHADOW);
        }
        slopes
    }
}
