//! Past motor positions, which rebuild the memory of another model.
//!
//! Hysteresis depends on the turning points of a motion. The history stores the corners of the
//! motion of both motors: every point where one motor reverses, and a point every few counts in
//! between. The points in between matter because load-dependent friction also depends on the
//! combined motion of the motors. Between two corners every motor moves in one direction only, so
//! play operators that are advanced from corner to corner end exactly where the whole motion ends.
//! A force balance ends some counts off after quick motion of both motors, because a step's
//! friction depends on the tension before it; the difference shrinks with further motion. Every
//! corner stores the time since the previous one, for snakes that creep.

use std::collections::VecDeque;

use crate::units::MotorVec;

/// The most stored corners. At one corner every [`SPACING_COUNTS`] they cover 16 full ranges of
/// 2000 counts.
const CORNERS: usize = 4096;

/// The longest motion of a motor between two corners, counts.
const SPACING_COUNTS: f64 = 8.0;

/// The latest corners of the motor motion. All memory is allocated at construction;
/// [`Self::note`] allocates nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// Each with the time since the one before, s.
    corners: VecDeque<(MotorVec, f64)>,
    /// The present position of the motors.
    newest: Option<MotorVec>,
    /// Time since the last corner, s.
    time_s: f64,
}

impl Default for History {
    fn default() -> Self {
        Self { corners: VecDeque::with_capacity(CORNERS), newest: None, time_s: 0.0 }
    }
}

impl History {
    /// Adds a position. A position that is not finite is ignored.
    pub fn note(&mut self, counts: &MotorVec) {
        self.push_after(counts, 0.0);
    }

    /// The same, a time after the position before.
    pub fn push_after(&mut self, counts: &MotorVec, time_s: f64) {
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
            self.corners.push_back((newest, self.time_s));
            self.time_s = 0.0;
        }
        self.newest = Some(*counts);
        self.time_s += time_s;
    }

    /// Clears the history. Call this after the zero moves: stored counts refer to the old zero.
    pub fn forget(&mut self) {
        self.corners.clear();
        self.newest = None;
        self.time_s = 0.0;
    }

    /// The corners, oldest first, followed by the present position.
    pub fn positions(&self) -> impl Iterator<Item = &MotorVec> {
        self.steps().map(|(counts, _)| counts)
    }

    /// The same, each with the time since the one before, s.
    pub fn steps(&self) -> impl Iterator<Item = (&MotorVec, f64)> {
        let corners = self.corners.iter().map(|(counts, time_s)| (counts, *time_s));
        corners.chain(self.newest.iter().map(|counts| (counts, self.time_s)))
    }

    /// Whether the motion reverses at `newest` before `next`, or is longer than the spacing.
    fn is_corner(&self, newest: &MotorVec, next: &MotorVec) -> bool {
        let Some((last, _)) = self.corners.back() else { return true };
        last.iter().zip(newest).zip(next).any(|((last, newest), next)| {
            let (previous_step, next_step) = (newest - last, next - newest);
            previous_step * next_step < 0.0 || (next - last).abs() > SPACING_COUNTS
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_reversals_and_points_at_the_spacing() {
        let mut history = History::default();
        for count in (0..=20).chain((10..20).rev()) {
            history.note(&[f64::from(count), 0.0]);
        }
        history.note(&[f64::NAN, 0.0]);
        let positions: Vec<f64> = history.positions().map(|counts| counts[0]).collect();
        assert_eq!(positions, [0.0, 8.0, 16.0, 20.0, 12.0, 10.0]);
        history.forget();
        assert_eq!(history.positions().count(), 0);
    }

    #[test]
    fn the_oldest_corners_are_dropped_and_the_capacity_is_constant() {
        let mut history = History::default();
        let capacity = history.corners.capacity();
        for i in 0..20_000 {
            history.note(&[f64::from(i % 2), 0.0]);
        }
        assert_eq!((history.corners.len(), history.corners.capacity()), (CORNERS, capacity));
    }
}
