//! Where the motors have been, so that the memory of another model can be rebuilt from the same
//! past.
//!
//! What hysteresis remembers of a way are its turning points. The history keeps the corners of the
//! way of both motors: wherever one of them turned back, and every so many counts in between,
//! because friction that grows with the pull also depends on how the motors went together. Between
//! two corners every motor goes one way only, so play operators that are led from corner to corner
//! end exactly where the whole way would have brought them.

use std::collections::VecDeque;

use crate::units::MotorVec;

/// Corners that are kept. At one every [`SPACING_COUNTS`] they are 16 full strokes of 2000 counts.
const CORNERS: usize = 4096;

/// The longest way of a motor between two corners, counts.
const SPACING_COUNTS: f64 = 8.0;

/// The latest corners of the way of the motors. Takes all its memory at once; noting a position
/// allocates nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    corners: VecDeque<MotorVec>,
    /// Where the motors are.
    newest: Option<MotorVec>,
}

impl Default for History {
    fn default() -> Self {
        Self {
            corners: VecDeque::with_capacity(CORNERS),
            newest: None,
        }
    }
}

impl History {
    /// Takes note of a position; what is not finite is not noted.
    pub fn note(&mut self, counts: &MotorVec) {
        if !counts.iter().all(|c| c.is_finite()) {
            return;
        }
        if let Some(newest) = self.newest
            && newest != *counts
            && self.is_corner(&newest, counts)
        {
            if self.corners.len() == CORNERS {
                self.corners.pop_front();
            }
            self.corners.push_back(newest);
        }
        self.newest = Some(*counts);
    }

    /// The zero has moved: what was noted belongs to other counts.
    pub fn forget(&mut self) {
        self.corners.clear();
        self.newest = None;
    }

    /// The corners in order, and then where the motors are.
    pub fn positions(&self) -> impl Iterator<Item = &MotorVec> {
        self.corners.iter().chain(&self.newest)
    }

    /// Whether the way turns or has become long at `newest`, before going on to `next`.
    fn is_corner(&self, newest: &MotorVec, next: &MotorVec) -> bool {
        let Some(last) = self.corners.back() else {
            return true;
        };
        last.iter()
            .zip(newest)
            .zip(next)
            .any(|((last, newest), next)| {
                let (came, goes) = (newest - last, next - newest);
                came * goes < 0.0 || (next - last).abs() > SPACING_COUNTS
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_turns_and_some_places_in_between() {
        let mut history = History::default();
        for count in (0..=20).chain((10..20).rev()) {
            history.note(&[f64::from(count), 0.0]);
        }
        history.note(&[f64::NAN, 0.0]);
        let places: Vec<f64> = history.positions().map(|counts| counts[0]).collect();
        assert_eq!(places, [0.0, 8.0, 16.0, 20.0, 12.0, 10.0]);
        history.forget();
        assert_eq!(history.positions().count(), 0);
    }

    #[test]
    fn the_oldest_corners_go_first_and_nothing_grows() {
        let mut history = History::default();
        let capacity = history.corners.capacity();
        (0..20_000).for_each(|i| history.note(&[f64::from(i % 2), 0.0]));
        assert_eq!(
            (history.corners.len(), history.corners.capacity()),
            (CORNERS, capacity)
        );
    }
}
