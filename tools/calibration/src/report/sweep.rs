//! A sweep back and forth through the middle of the calibrated region, which shows the branches of
//! a model.

use i2ris::model::{Hull, Model};
use i2ris::units::MotorVec;

use super::fit::{Branches, Straight};

/// Positions of the rising half, and of the falling half.
const POSITIONS: usize = 160;

/// Time between two positions, which affects creeping snakes, s.
const POSITION_S: f64 = 0.05;

/// Sweeps before the recorded one: they make the memory independent of the past.
const SWEEPS_BEFORE: usize = 3;

/// Halvings of the search for the end of a sweep: to a millionth of a count.
const HALVINGS: u32 = 60;

/// The largest sweep, counts: beyond what any motor can do.
const FURTHEST: f64 = 1e7;

/// A straight path through the middle of a hull, from one end to the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sweep {
    from: MotorVec,
    to: MotorVec,
}

impl Sweep {
    /// The sweep in a direction.
    pub fn new(hull: &Hull, direction: MotorVec) -> Self {
        let centre = hull.centre();
        let point = |distance: f64| step(centre, direction, distance);
        let end = |sign: f64| {
            let (mut inside, mut outside) = (0.0, sign * FURTHEST);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (inside + outside);
                if hull.contains(&point(middle)) { inside = middle } else { outside = middle }
            }
            point(inside)
        };
        Self { from: end(-1.0), to: end(1.0) }
    }

    /// Positions from one end to the other.
    pub fn positions(&self) -> impl DoubleEndedIterator<Item = MotorVec> + '_ {
        (0..POSITIONS).map(move |i| {
            let share = i as f64 / (POSITIONS - 1) as f64;
            std::array::from_fn(|motor| {
                self.from[motor] + share * (self.to[motor] - self.from[motor])
            })
        })
    }
}

fn step(from: MotorVec, direction: MotorVec, distance: f64) -> MotorVec {
    std::array::from_fn(|motor| from[motor] + distance * direction[motor])
}

/// The branches of a model for one output; `unit` is the output's unit in rad or m.
pub(super) fn branches(model: &Model, output: usize, straight: &Straight, unit: f64) -> Branches {
    let sweep = Sweep::new(model.hull(), straight.direction());
    let mut memory = model.new_memory();
    let mut point = |counts: MotorVec| {
        model.advance_over(&mut memory, &counts, POSITION_S);
        let mean = model.predict(&counts, &memory).mean[output] / unit;
        [straight.along(&counts), mean, straight.at(&counts)]
    };
    for _ in 0..SWEEPS_BEFORE {
        for counts in sweep.positions().chain(sweep.positions().rev()) {
            point(counts);
        }
    }
    let rising = sweep.positions().map(&mut point).collect();
    let falling = sweep.positions().rev().map(&mut point).collect();
    Branches { rising, falling }
}
