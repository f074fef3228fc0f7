//! The exact inverse of a snake: counts that move a copy, with its whole state, to a goal.
//!
//! No controller has it. Its remaining error is the cost of the motor limits.

use i2ris::units::MotorVec;
use i2ris_simulation::physics::Snake;

/// Tolerance of a goal, deg.
const TOLERANCE_DEG: f64 = 0.003;
/// Steps of the search. Crossing a gap takes about ten; a turn of two coupled motors takes more.
const MAX_STEPS: usize = 150;
/// Time that a copy gets to reach the goal, s: drag would slow a jump within a tick.
const STEP_S: f64 = 0.02;
/// Longer strokes than this are outside the position limits, counts.
const LIMIT_COUNTS: f64 = 2400.0;
/// An interval narrower than this, or inverted, is not valid any more: the other motor moved.
const NARROW_COUNTS: f64 = 0.02;
/// Growth of the step if a motor has not come nearer.
const GROWTH: f64 = 2.5;

#[derive(Debug, Clone)]
pub struct ExactInverse {
    /// Counts per degree: motor by axis.
    counts_per_deg: [[f64; 2]; 2],
    counts: MotorVec,
}

impl ExactInverse {
    /// For a straight snake: takes its mean gain from strokes of a copy.
    pub fn new(snake: &Snake) -> Self {
        let stroke = |motor: usize| {
            let end = |counts: f64| {
                let mut copy = snake.clone();
                let mut at = MotorVec::default();
                for step in 1..=100 {
                    at[motor] = counts * f64::from(step) / 100.0;
                    copy.step(STEP_S, at);
                }
                copy.angles_deg()
            };
            let (high, low) = (end(1000.0), end(-1000.0));
            [0, 1].map(|axis: usize| (high[axis] - low[axis]) / 2000.0)
        };
        let [[a, c], [b, d]] = [stroke(0), stroke(1)];
        let determinant = a * d - b * c;
        let counts_per_deg = [[d, -b], [-c, a]].map(|row| row.map(|it| it / determinant));
        Self { counts_per_deg, counts: MotorVec::default() }
    }

    pub fn solve(&mut self, snake: &Snake, goal: [f64; 2]) -> MotorVec {
        let mut searches = self.counts.map(Search::new);
        let mut best = (f64::INFINITY, self.counts);
        for _ in 0..MAX_STEPS {
            let counts = [searches[0].at, searches[1].at];
            let mut copy = snake.clone();
            copy.step(STEP_S, counts);
            let angles = copy.angles_deg();
            let error = [goal[0] - angles[0], goal[1] - angles[1]];
            let size = error[0].hypot(error[1]);
            if size < best.0 {
                best = (size, counts);
            }
            if size < TOLERANCE_DEG {
                break;
            }
            for (search, row) in searches.iter_mut().zip(self.counts_per_deg) {
                search.step(row[0] * error[0] + row[1] * error[1]);
            }
        }
        self.counts = best.1;
        best.1
    }
}

/// The search for the counts of one motor. The bend grows with the counts, but not everywhere.
#[derive(Debug, Clone, Copy)]
struct Search {
    at: f64,
    last: f64,
    factor: f64,
    /// Largest count that is too small, smallest that is too large. The other motor moves them.
    low: Option<f64>,
    high: Option<f64>,
}

impl Search {
    fn new(at: f64) -> Self {
        Self { at, last: 0.0, factor: 1.0, low: None, high: None }
    }

    /// `missing`: the missing counts, estimated from the mean gain.
    fn step(&mut self, missing: f64) {
        if missing * self.last < 0.0 {
            // Overshoot.
            self.factor *= 0.4;
        } else if self.last != 0.0 && missing.abs() > 0.6 * self.last.abs() {
            self.factor *= GROWTH;
        }
        self.last = missing;
        let end = if missing > 0.0 { &mut self.low } else { &mut self.high };
        *end = Some(self.at);
        let step = (self.factor * missing).clamp(-200.0, 200.0);
        let mut next = self.at + step;
        if let (Some(low), Some(high)) = (self.low, self.high) {
            if high - low < NARROW_COUNTS {
                (self.low, self.high, self.factor) = (None, None, 1.0);
            } else if next <= low || next >= high {
                next = 0.5 * (low + high);
            }
        }
        self.at = next.clamp(-LIMIT_COUNTS, LIMIT_COUNTS);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use i2ris_simulation::physics::{DrawnSnake, Physics};

    /// Follows a Lissajous figure; every motor jumps to the counts of the inverse.
    #[test]
    fn it_meets_its_goals_on_every_physics() {
        for physics in Physics::ALL.iter().copied() {
            let mut snake = DrawnSnake { physics, seed: 2 }.build();
            let mut inverse = ExactInverse::new(&snake);
            for tick in 0..2000 {
                let phase = f64::from(tick) * 0.01;
                let goal = [15.0 * phase.sin(), 12.0 * (1.3 * phase).sin()];
                let counts = inverse.solve(&snake, goal);
                snake.step(STEP_S, counts);
                let [pitch, yaw] = snake.angles_deg();
                let apart = (pitch - goal[0]).hypot(yaw - goal[1]);
                assert!(apart < 0.02, "{physics} at {tick}: {apart}");
            }
        }
    }
}
