//! Shared by all drawn snakes besides the hysteresis: the gains of the motors, their coupling, the
//! planes in which they bend, and the shape of the bend. No memory.

use super::draw::{Draw, Pair};
use crate::ageing::AgeingEffect;

/// Largest valid motor position, counts.
const MAX_COUNTS: f64 = 1e4;

/// Maps counts to wire travel, and the bend of each motor to pitch and yaw.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Frame {
    /// Wire travel per count, degrees of bend without losses.
    pub deg_per_count: Pair,
    /// Share of the other motor's travel that a motor's wires see: the pulleys share an axle.
    pull: Pair,
    /// The plane that each motor bends, as a direction in pitch and yaw.
    planes: [Pair; 2],
    /// Bend at which the gain has fallen to 0.71, degrees: joints stiffen.
    softening_deg: f64,
    /// Gain difference between the two directions of pitch and of yaw.
    asymmetry: Pair,
}

impl Frame {
    pub(super) fn draw(draw: &mut Draw) -> Self {
        let gain = draw.uniform(0.0225, 0.026);
        // As on the robot, the motors bend at 45 degrees to pitch and yaw, with the tolerance of
        // this size.
        let turn = 45.0 + draw.uniform(-6.0, 6.0);
        let planes = [turn, turn + 90.0 + draw.uniform(-5.0, 5.0)].map(|angle: f64| {
            let (sin, cos) = angle.to_radians().sin_cos();
            [cos, sin]
        });
        Self {
            deg_per_count: draw.both(0.95, 1.05).map(|factor| gain * factor),
            pull: draw.both(-0.12, 0.12),
            planes,
            softening_deg: draw.uniform(80.0, 150.0),
            asymmetry: draw.both(-0.06, 0.06),
        }
    }

    /// Wire travel, degrees. A position that is not finite leaves its motor where it was.
    pub(super) fn travel(&self, counts: Pair, last: &mut Pair, effect: &AgeingEffect) -> Pair {
        for (last, counts) in last.iter_mut().zip(counts) {
            if counts.is_finite() {
                *last = counts.clamp(-MAX_COUNTS, MAX_COUNTS);
            }
        }
        let own = [0, 1].map(|motor: usize| {
            effect.gain[motor] * self.deg_per_count[motor] * last[motor] + effect.travel_deg[motor]
        });
        [0, 1].map(|motor: usize| own[motor] + self.pull[motor] * own[1 - motor])
    }

    /// Pitch and yaw, degrees.
    pub(super) fn angles_deg(&self, bend: Pair) -> Pair {
        let [first, second] = self.planes;
        let angles = [0, 1].map(|axis: usize| bend[0] * first[axis] + bend[1] * second[axis]);
        let far = angles[0].hypot(angles[1]) / self.softening_deg;
        let softer = 1.0 / (1.0 + far * far).sqrt();
        [0, 1].map(|axis: usize| {
            let angle = softer * angles[axis];
            // The corner at 0 is rounded over some degrees.
            angle * (1.0 + self.asymmetry[axis] * (angle / 10.0).tanh())
        })
    }
}
