//! The force balance on pulleys and segments during one small step, and its solver.
//!
//! ```text
//! motor --(backlash)-- pulley ~~wire~~ [segment 1 | segment 2 | ...] tip
//!                        |                 |           |
//!                     friction       friction, stiffness, stop
//! ```
//!
//! Masses are negligible: forces balance at every instant. Within a step the friction bristles are
//! integrated implicitly (return mapping, as in computational plasticity, Simo and Hughes 1998), so
//! a step of any size is stable. The limits of friction are those of the state before the step.

use super::config::{GearConfig, MAX_SEGMENTS, SnakeConfig};
use super::forces::{BreakAway, Bristles, Force, FrictionForce, contact, gap, return_mapping};
use crate::physics::hysteresis::{Pair, add, dot, subtract};

/// The complete state of the snake, in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct State {
    /// Wire travel of the motors.
    pub motor: Pair,
    /// Positions of the pulleys.
    pub pulley: Pair,
    /// Bristles under the pulleys.
    pub pulley_bristle: Pair,
    /// Bends of the segments, pitch and yaw.
    pub bend: [Pair; MAX_SEGMENTS],
    pub bristles: [Bristles; MAX_SEGMENTS],
}

impl State {
    /// Pitch and yaw of the tip, without the drift of the zero.
    pub(super) fn total_bend(&self) -> Pair {
        self.bend.iter().fold([0.0; 2], |sum, bend| add(sum, *bend))
    }
}

/// One prepared step.
pub(super) struct Step<'a> {
    config: &'a SnakeConfig,
    /// The planes that the motors bend, as directions in pitch and yaw.
    axes: [Pair; 2],
    before: State,
    motor: Pair,
    break_away: BreakAway,
    /// Drag per distance: `drag_s / dt`.
    drag: f64,
}

impl<'a> Step<'a> {
    /// `motor`: positions after it. `friction`: factor on the normal friction, by motor.
    pub(super) fn new(
        config: &'a SnakeConfig,
        axes: [Pair; 2],
        before: State,
        motor: Pair,
        dt_s: f64,
        friction: Pair,
    ) -> Self {
        let mut step = Self {
            config,
            axes,
            before,
            motor,
            break_away: BreakAway::default(),
            drag: config.drag_s / dt_s,
        };
        let bend = before.total_bend();
        let tensions = [0, 1].map(|motor| step.tensions(motor, before.pulley[motor], bend));
        step.break_away = BreakAway::new(&config.friction, tensions, bend, friction);
        step
    }

    /// The state after the step.
    pub(super) fn solve(&self) -> State {
        let count = self.config.segments.len();
        let size = 2 + 2 * count;
        let mut at = [0.0; SIZE];
        at[..2].copy_from_slice(&self.before.pulley);
        at[2..size].copy_from_slice(self.before.bend[..count].as_flattened());
        let at = solve(size, at, |at| self.forces(at));
        let mut after = State { motor: self.motor, pulley: [at[0], at[1]], ..self.before };
        after.pulley_bristle = [0, 1].map(|motor: usize| self.pulley_friction(motor, at[motor]).1);
        for segment in 0..count {
            let bend = [at[2 + 2 * segment], at[3 + 2 * segment]];
            after.bend[segment] = bend;
            after.bristles[segment] = self.segment_friction(segment, bend).bristles;
        }
        after
    }

    fn forces(&self, at: &Vector) -> Forces {
        let (mut forces, mut total) = (([0.0; SIZE], [[0.0; SIZE]; SIZE]), [0.0; 2]);
        for segment in 0..self.config.segments.len() {
            let bend = [at[2 + 2 * segment], at[3 + 2 * segment]];
            total = add(total, bend);
            self.add_segment(segment, bend, &mut forces);
        }
        self.add_motor(0, at[0], total, &mut forces);
        self.add_motor(1, at[1], total, &mut forces);
        forces
    }

    /// Tension of the wire that pulls to positive angles, and of the other.
    fn tensions(&self, motor: usize, pulley: f64, bend: Pair) -> [Force; 2] {
        let stretch = self.stretch(motor, pulley, bend);
        let slack = self.config.wire.slack_deg[motor];
        let softness = self.config.wire.softness_deg;
        [contact(stretch - slack[0], softness), contact(-stretch - slack[1], softness)]
    }

    /// Travel of the pulley minus the travel that the bend takes up.
    fn stretch(&self, motor: usize, pulley: f64, bend: Pair) -> f64 {
        pulley - dot(self.axes[motor], bend)
    }

    fn wire(&self, motor: usize, pulley: f64, bend: Pair) -> Force {
        let [up, down] = self.tensions(motor, pulley, bend);
        let loose = self.config.wire.slack_stiffness;
        let stretch = self.stretch(motor, pulley, bend);
        Force::new(up.value - down.value + loose * stretch, up.slope + down.slope + loose)
    }

    /// Friction under the pulley, and its bristle after the step, as stiff as a flank.
    fn pulley_friction(&self, motor: usize, pulley: f64) -> (Force, f64) {
        let stiffness = self.config.gear.contact_stiffness;
        let trial = self.before.pulley_bristle[motor] + pulley - self.before.pulley[motor];
        let limit = self.config.gear.friction[motor] / stiffness;
        let bristle = return_mapping([trial, 0.0], limit);
        let (bend, slope) = (bristle.bend[0], bristle.slope[0][0]);
        (Force::new(bend, slope).scaled(stiffness), bend)
    }

    /// Friction of a segment that has moved to `bend`.
    fn segment_friction(&self, segment: usize, bend: Pair) -> FrictionForce {
        let moved = subtract(bend, self.before.bend[segment]);
        let share = self.config.segments[segment].friction;
        let (config, break_away) = (&self.config.friction, &self.break_away);
        self.before.bristles[segment].slide(config, break_away, share, self.axes, moved)
    }

    /// Restoring force of a segment in one direction: stiffening elasticity, and the stop.
    fn restoring(&self, segment: usize, bend: f64) -> Force {
        let law = &self.config.segments[segment];
        let stop = gap(bend, law.limit_deg, 0.1 * law.limit_deg).scaled(self.config.stop_stiffness);
        Force::new(
            (law.stiffness + law.stiffening * bend * bend) * bend + stop.value,
            law.stiffness + 3.0 * law.stiffening * bend * bend + stop.slope,
        )
    }

    /// Adds the forces of one segment: elasticity, stop, friction, drag.
    fn add_segment(&self, segment: usize, bend: Pair, (force, slope): &mut Forces) {
        let row = 2 + 2 * segment;
        let friction = self.segment_friction(segment, bend);
        for axis in 0..2 {
            let restoring = self.restoring(segment, bend[axis]);
            let moved = bend[axis] - self.before.bend[segment][axis];
            force[row + axis] += restoring.value + self.drag * moved + friction.force[axis];
            slope[row + axis][row + axis] += restoring.slope + self.drag;
            for other in 0..2 {
                slope[row + axis][row + other] += friction.slope[axis][other];
            }
        }
    }

    /// Adds the forces of one motor: gear, friction of the pulley, and its wires to all segments.
    fn add_motor(&self, motor: usize, pulley: f64, bend: Pair, (force, slope): &mut Forces) {
        let flank = flank_force(&self.config.gear, motor, self.motor[motor] - pulley);
        let wire = self.wire(motor, pulley, bend);
        let friction = self.pulley_friction(motor, pulley).0;
        force[motor] += friction.value + wire.value - flank.value
            + self.drag * (pulley - self.before.pulley[motor]);
        slope[motor][motor] += friction.slope + wire.slope + flank.slope + self.drag;
        let axis = self.axes[motor];
        let rows = 2..2 + 2 * self.config.segments.len();
        for row in rows.clone() {
            let along = axis[row % 2];
            force[row] -= along * wire.value;
            slope[motor][row] -= along * wire.slope;
            slope[row][motor] -= along * wire.slope;
            for column in rows.clone() {
                slope[row][column] += along * axis[column % 2] * wire.slope;
            }
        }
    }
}

/// Force of a motor on its pulley through the backlash of the gear; `travel`: motor minus pulley.
pub(super) fn flank_force(gear: &GearConfig, motor: usize, travel: f64) -> Force {
    let half = 0.5 * gear.backlash_deg[motor];
    gap(travel, half, gear.softness_deg).scaled(gear.contact_stiffness)
}

/// Maximum number of unknowns: two pulleys, and segments that bend in two directions.
const SIZE: usize = 2 + 2 * MAX_SEGMENTS;

type Vector = [f64; SIZE];

/// Slopes of the forces: symmetric, positive definite in its first rows and columns.
type Matrix = [[f64; SIZE]; SIZE];

/// The residual forces at a point, which must be 0, and their slopes.
type Forces = (Vector, Matrix);

/// Sufficient for the worst start in the tests, and a bound on the time.
const ITERATIONS: usize = 60;
/// Forces below this share of the largest force at the start count as 0.
const RELATIVE_TOLERANCE: f64 = 1e-12;
/// Forces below this (degrees of wire stretch) count as 0: a millionth of an encoder count.
const TOLERANCE: f64 = 1e-8;

/// Solves a balance of `size` unknowns from the guess `start` by Newton's method, for the gradient
/// of a strictly convex potential. Returns the best point found; it is finite if `start` is.
///
/// The slopes of the laws have kinks, so a full step can overshoot. Along a step the force is
/// monotonic: the step is shortened by regula falsi until it overshoots little.
fn solve(size: usize, start: Vector, forces: impl Fn(&Vector) -> Forces) -> Vector {
    let mut at = start;
    let (mut force, mut slope) = forces(&at);
    let tolerance = TOLERANCE.max(RELATIVE_TOLERANCE * largest(&force, size));
    for _ in 0..ITERATIONS {
        if largest(&force, size) <= tolerance {
            break;
        }
        let Some(step) = newton_step(slope, &force, size) else {
            break;
        };
        let next = line_search(&forces, &at, &step, product(&force, &step, size), size);
        if !next.1.iter().all(|value| value.is_finite()) {
            break;
        }
        (at, force, slope) = next;
    }
    at
}

/// Shortens `step` until the force along it, at the start `before` (below 0), is small.
fn line_search(
    forces: &impl Fn(&Vector) -> Forces,
    from: &Vector,
    step: &Vector,
    before: f64,
    size: usize,
) -> (Vector, Vector, Matrix) {
    let mut share = 1.0;
    loop {
        let mut at = *from;
        for (value, step) in at.iter_mut().zip(step) {
            *value += share * step;
        }
        let (force, slope) = forces(&at);
        let after = product(&force, step, size);
        if after <= -0.5 * before || share < 1e-6 {
            return (at, force, slope);
        }
        share *= (before / (before - after)).clamp(0.1, 0.9);
    }
}

/// `-slope^-1 force` by Cholesky's factorisation, or `None` if the matrix is not positive definite.
fn newton_step(mut slope: Matrix, force: &Vector, size: usize) -> Option<Vector> {
    for column in 0..size {
        for row in column..size {
            let done: f64 = (0..column).map(|k| slope[row][k] * slope[column][k]).sum();
            let rest = slope[row][column] - done;
            if row > column {
                slope[row][column] = rest / slope[column][column];
            } else if rest > 0.0 {
                slope[row][column] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    let mut step = [0.0; SIZE];
    for row in 0..size {
        let done: f64 = (0..row).map(|k| slope[row][k] * step[k]).sum();
        step[row] = (-force[row] - done) / slope[row][row];
    }
    for row in (0..size).rev() {
        let done: f64 = (row + 1..size).map(|k| slope[k][row] * step[k]).sum();
        step[row] = (step[row] - done) / slope[row][row];
    }
    Some(step)
}

fn product(a: &Vector, b: &Vector, size: usize) -> f64 {
    a.iter().zip(b).take(size).map(|(a, b)| a * b).sum()
}

fn largest(values: &Vector, size: usize) -> f64 {
    values[..size].iter().fold(0.0, |most, value| most.max(value.abs()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Two unknowns tied by a spring, one at a stiff stop: a kink that a Newton step jumps over.
    fn stop(at: &Vector) -> Forces {
        let (mut force, mut slope) = ([0.0; SIZE], [[0.0; SIZE]; SIZE]);
        let stop = if at[0] > 1.0 { 1e4 } else { 0.0 };
        force[0] = at[0] - at[1] + stop * (at[0] - 1.0);
        force[1] = at[1] - at[0] + 0.1 * (at[1] - 5.0);
        slope[0][..2].copy_from_slice(&[1.0 + stop, -1.0]);
        slope[1][..2].copy_from_slice(&[-1.0, 1.1]);
        (force, slope)
    }

    #[test]
    fn the_solution_across_a_kink_is_found() {
        for start in [-1e6, 0.0, 3.0, 1e6] {
            let at = solve(2, [start; SIZE], stop);
            let (force, _) = stop(&at);
            assert!(largest(&force, 2) < 1e-6, "{start}: {force:?}");
            assert!(at[0] > 1.0 && at[0] < 1.001);
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_step() {
        let mut slope = [[0.0; SIZE]; SIZE];
        slope[0][0] = -1.0;
        assert_eq!(newton_step(slope, &[1.0; SIZE], 1), None);
    }

    proptest! {
        #[test]
        fn the_slopes_are_the_derivatives_of_the_forces(
            at in prop::array::uniform10(-20.0..20.0f64),
            unknown in 0..8usize,
        ) {
            let config = crate::physics::springs::tests::config("multi");
            let axes = [[0.6, 0.8], [-0.8, 0.6]];
            let step = Step::new(&config, axes, State::default(), [3.0, -2.0], 1e-2, [1.0; 2]);
            let size = 1e-6;
            let (mut above, mut below) = (at, at);
            above[unknown] += size;
            below[unknown] -= size;
            let (_, slopes) = step.forces(&at);
            let (more, less) = (step.forces(&above).0, step.forces(&below).0);
            for row in 0..2 + 2 * config.segments.len() {
                let difference = (more[row] - less[row]) / (2.0 * size);
                let slope = slopes[row][unknown];
                let error = (difference - slope).abs();
                prop_assert!(error < 1e-3 * (1.0 + difference.abs()), "{difference} {slope}");
                prop_assert!((slope - slopes[unknown][row]).abs() < 1e-12);
            }
        }
    }
}
