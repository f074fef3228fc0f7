//! The force balance on pulleys and segments during one small step.
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
use super::newton::{ForceBalance, Matrix, SIZE, Vector, solve};
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

    /// Reduces the deflections of all bristles to the share `left`.
    pub(super) fn creep(&mut self, left: f64) {
        for bristles in &mut self.bristles {
            bristles.creep(left);
        }
    }

    fn unknowns(&self, segments: usize) -> Vector {
        let mut at = [0.0; SIZE];
        at[..2].copy_from_slice(&self.pulley);
        at[2..2 + 2 * segments].copy_from_slice(self.bend[..segments].as_flattened());
        at
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

/// Inputs of a step.
pub(super) struct Drive {
    /// Positions of the motors after it.
    pub motor: Pair,
    pub dt_s: f64,
    /// Factor on the normal friction, by motor.
    pub friction: Pair,
}

impl<'a> Step<'a> {
    pub(super) fn new(
        config: &'a SnakeConfig,
        axes: [Pair; 2],
        before: State,
        Drive { motor, dt_s, friction }: Drive,
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
        let at = solve(self, self.before.unknowns(count));
        let mut after = State { motor: self.motor, pulley: [at[0], at[1]], ..self.before };
        after.pulley_bristle = [0, 1].map(|motor: usize| self.pulley_friction(motor, at[motor]).1);
        for segment in 0..count {
            let bend = [at[2 + 2 * segment], at[3 + 2 * segment]];
            after.bend[segment] = bend;
            after.bristles[segment] = self.segment_friction(segment, bend).bristles;
        }
        after
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

    /// Friction under the pulley, and its bristle after the step. The bristle is as stiff as a
    /// flank.
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
    fn add_segment(&self, segment: usize, bend: Pair, force: &mut Vector, slope: &mut Matrix) {
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

    /// Adds the forces of one motor: gear, friction of the pulley, and the wires from the pulley to
    /// all segments.
    fn add_motor(
        &self,
        motor: usize,
        pulley: f64,
        bend: Pair,
        force: &mut Vector,
        slope: &mut Matrix,
    ) {
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
fn flank_force(gear: &GearConfig, motor: usize, travel: f64) -> Force {
    let half = 0.5 * gear.backlash_deg[motor];
    gap(travel, half, gear.softness_deg).scaled(gear.contact_stiffness)
}

/// Force of a motor on its pulley in a state.
pub(super) fn flank(gear: &GearConfig, motor: usize, state: &State) -> f64 {
    flank_force(gear, motor, state.motor[motor] - state.pulley[motor]).value
}

impl ForceBalance for Step<'_> {
    fn unknowns(&self) -> usize {
        2 + 2 * self.config.segments.len()
    }

    fn evaluate(&self, at: &Vector) -> (Vector, Matrix) {
        let (mut force, mut slope) = ([0.0; SIZE], [[0.0; SIZE]; SIZE]);
        let mut total = [0.0; 2];
        for segment in 0..self.config.segments.len() {
            let bend = [at[2 + 2 * segment], at[3 + 2 * segment]];
            total = add(total, bend);
            self.add_segment(segment, bend, &mut force, &mut slope);
        }
        self.add_motor(0, at[0], total, &mut force, &mut slope);
        self.add_motor(1, at[1], total, &mut force, &mut slope);
        (force, slope)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_slopes_are_the_derivatives_of_the_forces(
            at in prop::array::uniform10(-20.0..20.0f64),
            unknown in 0..8usize,
        ) {
            let config = crate::physics::springs::tests::config("multi");
            let axes = [[0.6, 0.8], [-0.8, 0.6]];
            let drive = Drive { motor: [3.0, -2.0], dt_s: 1e-2, friction: [1.0; 2] };
            let step = Step::new(&config, axes, State::default(), drive);
            let size = 1e-6;
            let (mut above, mut below) = (at, at);
            above[unknown] += size;
            below[unknown] -= size;
            let (_, slopes) = step.evaluate(&at);
            let (more, less) = (step.evaluate(&above).0, step.evaluate(&below).0);
            for row in 0..step.unknowns() {
                let difference = (more[row] - less[row]) / (2.0 * size);
                let slope = slopes[row][unknown];
                let error = (difference - slope).abs();
                prop_assert!(error < 1e-3 * (1.0 + difference.abs()), "{difference} {slope}");
                prop_assert!((slope - slopes[unknown][row]).abs() < 1e-12);
            }
        }
    }
}
