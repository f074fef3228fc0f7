//! Memories besides the one in use: as calibrated, and more worn.

use serde::{Deserialize, Serialize};

use super::geometry::{pair, subtract};
use super::{Pair, WORN};
use crate::model::{Memory, Model, Wear};
use crate::units::MotorVec;

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
