//! Correction: the applied part of the drift, and its motion (H23).
//!
//! The correction moves only while a goal moves, motor by motor, along the direction in which the
//! goal moves the motor, no faster than a limit and no faster than half of the goal's motion. So it
//! never moves a snake at rest and never reverses a motor. It is kept per motor: a correction
//! against the motion of a motor waits until the motor returns.
//!
//! A gap may also shrink: that slows a motor by a few counts per second while it moves, and does
//! not reverse it either.

use serde::{Deserialize, Serialize};

use super::budget::BudgetUse;
use super::excitation::Reach;
use super::{Settings, length};
use crate::core::drift::geometry::{ModelGeometry, add, product, subtract};
use crate::core::drift::{Correction, Drift, Pair};
use crate::model::Wear;
use crate::units::{MAX_MOTORS, MotorVec};

/// The correction moves a motor by at most this share of the goal's motion.
const SHARE: f64 = 0.5;

/// The correction comes no nearer to its target than this share per second: its parameters do not
/// jump where they cancel each other.
const NEARER_PER_S: f64 = 5.0;

/// Fastest change of the gap scale, 1/s.
const GAP_SLEW_PER_S: f64 = 0.02;

/// The same for slack and play.
const TRAVEL_SLEW_PER_S: f64 = 0.0005;

/// A gap scale changes while its motor moves at least this fast, counts/s: many times faster than
/// the change of the scale moves it.
const GAP_SPEED_COUNTS_S: f64 = 20.0;

/// A goal: its pose, and the motion of the motors by it in a tick, counts.
pub(super) struct MovedGoal {
    pub pose: Pair,
    pub motion: MotorVec,
}

/// The moving correction: one row per motor, in counts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct MovingCorrection {
    rows: [MotorRow; MAX_MOTORS],
    wear: Wear,
}

/// The shift of a motor: `zero + gain . pose`, counts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct MotorRow {
    zero: f64,
    gain: Pair,
}

impl MovingCorrection {
    /// Moves one tick towards a drift, inside the budget.
    pub(super) fn advance(
        &mut self,
        drift: &Drift,
        goal: &MovedGoal,
        reach: &Reach,
        geometry: &ModelGeometry,
        settings: &Settings,
    ) {
        let target = rows(drift, geometry);
        let slew = settings.slew * settings.tick_s;
        let mut steps: [MotorStep; MAX_MOTORS] = std::array::from_fn(|motor| {
            let motion = goal.motion[motor];
            let limit = SHARE * motion.abs();
            self.rows[motor].step(&target[motor], goal.pose, motion, limit, settings.tick_s)
        });
        let shares = shares_towards(&steps, &geometry.slope);
        let mut tips = [Pair::default(); MAX_MOTORS];
        for (motor, step) in steps.iter_mut().enumerate() {
            step.scale(shares[motor]);
            tips[motor] = [0, 1].map(|output: usize| geometry.slope[output][motor] * step.shift);
        }
        // Both motors together move the tip no faster than the limit, and so does each alone: the
        // budget may hold the other one back.
        let [first, second] = tips;
        let fastest = length(add(first, second)).max(length(first)).max(length(second));
        let share = if fastest > slew { slew / fastest } else { 1.0 };
        let mut used = self.used(reach, geometry, settings);
        for (motor, step) in steps.iter().enumerate() {
            let before = *self;
            self.rows[motor].take(step, share);
            if goal.motion[motor].abs() >= GAP_SPEED_COUNTS_S * settings.tick_s {
                let (to, wear) = (drift.wear(), &mut self.wear);
                let worn = [
                    (&mut wear.gap, to.gap, GAP_SLEW_PER_S),
                    (&mut wear.slack, to.slack, TRAVEL_SLEW_PER_S),
                    (&mut wear.play, to.play, TRAVEL_SLEW_PER_S),
                ];
                for (wear, to, slew_per_s) in worn {
                    let most = slew_per_s * settings.tick_s;
                    wear[motor] += (to[motor] - wear[motor]).max(-most).min(most);
                }
            }
            // The rows of the motors move at different times: together they may be more than what
            // was estimated at any time.
            let next = self.used(reach, geometry, settings);
            if next > 1.0 && next > used {
                *self = before;
            } else {
                used = next;
            }
        }
    }

    /// The largest share of the budget.
    fn used(&self, reach: &Reach, geometry: &ModelGeometry, settings: &Settings) -> f64 {
        let drift = self.correction(geometry).drift();
        BudgetUse::new(&drift, geometry, reach, settings).largest()
    }

    pub(super) fn correction(&self, geometry: &ModelGeometry) -> Correction {
        let zero = [self.rows[0].zero, self.rows[1].zero];
        let column = |column: usize| {
            let rows = [self.rows[0].gain[column], self.rows[1].gain[column]];
            product(&geometry.slope, rows)
        };
        let (first, second) = (column(0), column(1));
        Correction {
            zero: product(&geometry.slope, zero),
            gain: [[first[0], second[0]], [first[1], second[1]]],
            wear: self.wear,
        }
    }
}

/// Shares, 0 to 1, of both motor steps that bring the tip nearest to its fully corrected position.
/// If the wires of both axes are coupled, as in a wrist, one motor alone may move the tip away
/// while the other waits.
fn shares_towards(steps: &[MotorStep; MAX_MOTORS], slope: &[Pair; 2]) -> Pair {
    let [first, second] = [0, 1]
        .map(|motor: usize| [0, 1].map(|output: usize| slope[output][motor] * steps[motor].shift));
    let wanted = [0, 1].map(|output: usize| {
        let row = &slope[output];
        row[0] * steps[0].missing + row[1] * steps[1].missing
    });
    let dot = |a: Pair, b: Pair| a[0] * b[0] + a[1] * b[1];
    // The nearest point on a step, with the other share given.
    let best = |step: Pair, other: Pair| {
        let square = dot(step, step);
        let share = dot(step, subtract(wanted, other)) / square;
        if square > 0.0 { share.clamp(0.0, 1.0) } else { 0.0 }
    };
    let scaled = |step: Pair, share: f64| step.map(|part| share * part);
    let candidates = [0.0, 1.0].into_iter().flat_map(|share| {
        [[share, best(second, scaled(first, share))], [best(first, scaled(second, share)), share]]
    });
    let distance = |[a, b]: &Pair| {
        let moved = add(scaled(first, *a), scaled(second, *b));
        let left = subtract(wanted, moved);
        dot(left, left)
    };
    candidates.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or_default()
}

#[derive(Debug, Clone, Copy, Default)]
struct MotorStep {
    row: MotorRow,
    /// Motion of the motor at the present pose, counts.
    shift: f64,
    /// Motion by the whole correction, counts.
    missing: f64,
}

impl MotorStep {
    fn scale(&mut self, share: f64) {
        self.row.zero *= share;
        self.row.gain = self.row.gain.map(|gain| share * gain);
        self.shift *= share;
    }
}

impl MotorRow {
    /// The step towards a target, along the motion of the goal, that moves the motor by at most
    /// `limit`.
    fn step(&self, target: &Self, pose: Pair, motion: f64, limit: f64, tick_s: f64) -> MotorStep {
        let row = Self {
            zero: target.zero - self.zero,
            gain: [target.gain[0] - self.gain[0], target.gain[1] - self.gain[1]],
        };
        // The inverse subtracts the correction from the goal.
        let shift = -(row.zero + row.gain[0] * pose[0] + row.gain[1] * pose[1]);
        if motion == 0.0 || shift * motion < 0.0 {
            return MotorStep { missing: shift, ..MotorStep::default() };
        }
        let mut share = NEARER_PER_S * tick_s;
        if share * shift.abs() > limit {
            share = limit / shift.abs();
        }
        MotorStep {
            row: Self { zero: share * row.zero, gain: row.gain.map(|gain| share * gain) },
            shift: share * shift,
            missing: shift,
        }
    }

    fn take(&mut self, step: &MotorStep, share: f64) {
        self.zero += share * step.row.zero;
        self.gain[0] += share * step.row.gain[0];
        self.gain[1] += share * step.row.gain[1];
    }
}

fn rows(drift: &Drift, geometry: &ModelGeometry) -> [MotorRow; MAX_MOTORS] {
    let direction = geometry.corrected_direction();
    let zero =
        [drift.zero[0] + direction[0] * drift.slow, drift.zero[1] + direction[1] * drift.slow];
    let zero = geometry.counts(zero);
    let column = |column: usize| geometry.counts([drift.gain[0][column], drift.gain[1][column]]);
    let (first, second) = (column(0), column(1));
    std::array::from_fn(|motor| MotorRow { zero: zero[motor], gain: [first[motor], second[motor]] })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(shift: f64, missing: f64) -> MotorStep {
        MotorStep { shift, missing, ..MotorStep::default() }
    }

    #[test]
    fn motor_that_moves_the_tip_away_waits() {
        let apart = [[1.0, 0.0], [0.0, 1.0]];
        let shares = shares_towards(&[step(0.0, -1.0), step(0.01, 0.9)], &apart);
        assert_eq!(shares[1], 1.0);
        // Both wires bend the tip nearly alike.
        let coupled = [[1.0, 1.0], [0.0, 0.2]];
        let shares = shares_towards(&[step(0.0, -1.0), step(0.01, 0.9)], &coupled);
        assert_eq!(shares[1], 0.0);
        let shares = shares_towards(&[step(-0.01, -1.0), step(0.01, 0.9)], &coupled);
        assert_eq!(shares, [1.0, 0.0]);
        // Where the tip is led past, part of a step is the best.
        let shares = shares_towards(&[step(-0.01, -1.0), step(0.5, 0.99)], &coupled);
        assert!(shares[0] == 1.0 && shares[1] > 0.0 && shares[1] < 1.0, "{shares:?}");
    }
}
