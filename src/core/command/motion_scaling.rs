//! Motion scaling: the snake moves by a fraction of the master's motion.

use serde::{Deserialize, Serialize};

use crate::core::vector::zip_map;
use crate::units::OutputVec;

/// Displacement of the snake per displacement of the master.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct MotionScaling(f64);

impl MotionScaling {
    pub(super) fn new(scale: f64) -> Self {
        Self(scale)
    }

    /// Master and snake move by the same angles.
    pub(crate) fn is_unity(self) -> bool {
        self.0 == 1.0
    }

    /// The goal of the snake for a pose of the master. `master_reference` and `snake_reference`:
    /// the poses at which both were coupled.
    pub(super) fn apply(
        self,
        master: &OutputVec,
        master_reference: &OutputVec,
        snake_reference: &OutputVec,
    ) -> OutputVec {
        let displacement = zip_map(master, master_reference, |now, from| self.0 * (now - from));
        zip_map(snake_reference, &displacement, |snake, by| snake + by)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_snake_moves_by_the_scaled_displacement_from_its_reference() {
        let scaling = MotionScaling::new(0.25);
        let goal = scaling.apply(&[1.0, -2.0, 0.5], &[0.0, 2.0, 0.5], &[0.5, 0.0, -1.0]);
        assert_eq!(goal, [0.75, -1.0, -1.0]);
        assert!(!scaling.is_unity() && MotionScaling::new(1.0).is_unity());
    }
}
