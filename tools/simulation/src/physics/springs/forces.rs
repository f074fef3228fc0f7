//! Forces, each with its slope for Newton's method: force laws, and the friction of one segment.
//!
//! All of them are derivatives of convex potentials, so the balance has exactly one solution.

use super::config::{FrictionConfig, MAX_BRISTLES};
use crate::physics::hysteresis::{Pair, add, dot};

/// A force, degrees of wire stretch, and its slope over the displacement, per degree.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Force {
    pub value: f64,
    pub slope: f64,
}

impl Force {
    pub(super) fn new(value: f64, slope: f64) -> Self {
        Self { value, slope }
    }

    pub(super) fn scaled(self, factor: f64) -> Self {
        Self::new(factor * self.value, factor * self.slope)
    }
}

/// A one-sided spring: nothing below 0, stiffness 1 above, rounded over `softness` on both sides.
pub(super) fn contact(travel: f64, softness: f64) -> Force {
    if travel <= -softness {
        Force::default()
    } else if travel >= softness {
        Force::new(travel, 1.0)
    } else {
        let entered = travel + softness;
        Force::new(entered * entered / (4.0 * softness), entered / (2.0 * softness))
    }
}

/// Two opposing one-sided springs with a gap of `half` on both sides of 0.
pub(super) fn gap(travel: f64, half: f64, softness: f64) -> Force {
    let (up, down) = (contact(travel - half, softness), contact(-travel - half, softness));
    Force::new(up.value - down.value, up.slope + down.slope)
}

/// Deflection of a bristle after slipping, degrees, and its slope over the displacement, symmetric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Deflection {
    pub bend: Pair,
    pub slope: [Pair; 2],
}

/// Limits the trial deflection of a bristle to a circle of radius `limit` (return mapping).
/// Slipping in one direction leaves less friction in the other.
pub(super) fn return_mapping(trial: Pair, limit: f64) -> Deflection {
    let length = trial[0].hypot(trial[1]);
    if length <= limit {
        return Deflection { bend: trial, slope: [[1.0, 0.0], [0.0, 1.0]] };
    }
    let [x, y] = trial.map(|component| component / length);
    let scale = limit / length;
    let (xx, xy, yy) = (scale * (1.0 - x * x), scale * (0.0 - x * y), scale * (1.0 - y * y));
    Deflection { bend: [limit * x, limit * y], slope: [[xx, xy], [xy, yy]] }
}

/// Largest bend, radians. It prevents an overflow of the capstan equation.
const MAX_BEND_RAD: f64 = 2.0;

/// Break-away forces, each as if all friction was of that kind.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct BreakAway {
    /// In the joints, which all wires press on.
    shared: f64,
    /// In the guides of each motor's own wires.
    own: Pair,
}

impl BreakAway {
    /// Break-away forces from the capstan equation: `base + sum over wires of tension *
    /// (exp(coefficient * wrap) - 1)`. `tensions` are by motor and direction. The two pairs of
    /// wires press at right angles, so their loads add as vectors.
    pub(super) fn new(
        config: &FrictionConfig,
        tensions: [[Force; 2]; 2],
        bend: Pair,
        factor: Pair,
    ) -> Self {
        let bend_rad = bend[0].hypot(bend[1]).to_radians().min(MAX_BEND_RAD);
        let capstan = |tension: Force, wrap_deg: f64| {
            let wrap_rad = wrap_deg.to_radians() + bend_rad;
            tension.value * (config.coefficient * wrap_rad).exp_m1()
        };
        let load = [0, 1].map(|motor: usize| {
            let wires = tensions[motor].iter().zip(config.wrap_deg[motor]);
            wires.map(|(tension, wrap)| capstan(*tension, wrap)).sum::<f64>()
        });
        Self {
            shared: 0.5 * (factor[0] + factor[1]) * (config.base + load[0].hypot(load[1])),
            own: [0, 1].map(|motor: usize| factor[motor] * (config.base + load[motor])),
        }
    }
}

/// Deflections of one segment's bristles, degrees of bend.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Bristles {
    /// In the joints, by kind: pitch and yaw, limited by a circle.
    shared: [Pair; MAX_BRISTLES],
    /// In the guides, by kind: motor 0 and motor 1, each with its own limit.
    own: [Pair; MAX_BRISTLES],
}

/// The friction of a segment after a movement, pitch and yaw, and its slope, symmetric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrictionForce {
    /// The bristles after slipping.
    pub bristles: Bristles,
    pub force: Pair,
    pub slope: [Pair; 2],
}

impl Bristles {
    /// Moves the segment. `share` scales its break-away forces; `axes`: directions of the motors.
    pub(super) fn slide(
        &self,
        config: &FrictionConfig,
        break_away: &BreakAway,
        share: f64,
        axes: [Pair; 2],
        moved: Pair,
    ) -> FrictionForce {
        let mut friction = FrictionForce { bristles: *self, force: [0.0; 2], slope: [[0.0; 2]; 2] };
        for (kind, law) in config.bristles.iter().enumerate() {
            let limit = |break_away: f64| share * break_away * law.share / law.stiffness;
            let joint = return_mapping(add(self.shared[kind], moved), limit(break_away.shared));
            friction.bristles.shared[kind] = joint.bend;
            friction.add(law.stiffness * config.shared, joint.bend, joint.slope);
            for (motor, axis) in axes.into_iter().enumerate() {
                let trial = [self.own[kind][motor] + dot(axis, moved), 0.0];
                let guide = return_mapping(trial, limit(break_away.own[motor]));
                let (bend, slope) = (guide.bend[0], guide.slope[0][0]);
                friction.bristles.own[kind][motor] = bend;
                friction.add(
                    law.stiffness * (1.0 - config.shared),
                    axis.map(|along| bend * along),
                    axis.map(|along| axis.map(|across| slope * along * across)),
                );
            }
        }
        friction
    }

    /// Reduces all deflections to the share `left`.
    pub(super) fn creep(&mut self, left: f64) {
        for bend in self.shared.as_flattened_mut().iter_mut().chain(self.own.as_flattened_mut()) {
            *bend *= left;
        }
    }
}

impl FrictionForce {
    fn add(&mut self, stiffness: f64, bend: Pair, slope: [Pair; 2]) {
        self.force = add(self.force, bend.map(|bend| stiffness * bend));
        let scaled = slope.map(|row| row.map(|slope| stiffness * slope));
        self.slope = [add(self.slope[0], scaled[0]), add(self.slope[1], scaled[1])];
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const AXES: [Pair; 2] = [[1.0, 0.0], [0.0, 1.0]];

    fn config(shared: f64) -> FrictionConfig {
        FrictionConfig { shared, ..crate::physics::springs::tests::config("steel").friction }
    }

    fn tensions(tension: f64) -> [[Force; 2]; 2] {
        let mut tensions = [[Force::default(); 2]; 2];
        tensions[0][0] = Force::new(tension, 1.0);
        tensions
    }

    #[test]
    fn the_break_away_force_grows_with_tension_and_bend() {
        let force = |tension: f64, bend: f64| {
            BreakAway::new(&config(0.0), tensions(tension), [bend, 0.0], [1.0; 2]).own[0]
        };
        assert!(force(5.0, 0.0) > 1.1 * force(0.0, 0.0));
        assert!(force(5.0, 40.0) > 1.1 * force(5.0, 0.0));
        assert_eq!(force(0.0, 40.0), force(0.0, 0.0));
    }

    #[test]
    fn sliding_frees_the_other_axis_only_with_shared_friction() {
        for (shared, frees) in [(1.0, true), (0.0, false)] {
            let config = config(shared);
            let break_away = BreakAway::new(&config, tensions(0.0), [0.0; 2], [1.0; 2]);
            let slide = |from: Bristles, moved| from.slide(&config, &break_away, 1.0, AXES, moved);
            let first = slide(Bristles::default(), [5.0, 0.0]);
            let second = slide(first.bristles, [0.0, 5.0]);
            assert_eq!(second.force[0] < 0.5 * first.force[0], frees, "{first:?} {second:?}");
        }
    }

    #[test]
    fn a_contact_pushes_in_one_direction_only() {
        assert_eq!(contact(-1.0, 0.1), Force::default());
        assert_eq!(contact(2.0, 0.1), Force::new(2.0, 1.0));
        assert_eq!(gap(0.2, 0.5, 0.1), Force::default());
        assert!(gap(-1.0, 0.4, 0.1).value < -0.5);
    }

    proptest! {
        #[test]
        fn the_slope_is_the_derivative_of_the_force(travel in -2.0..2.0f64, half in 0.0..0.5f64) {
            let law = |x: f64| gap(x, half, 0.1);
            let difference = (law(travel + 1e-6).value - law(travel - 1e-6).value) / 2e-6;
            prop_assert!((difference - law(travel).slope).abs() < 1e-4);
        }

        #[test]
        fn a_bristle_stays_in_its_circle(
            x in -5.0..5.0f64,
            y in -5.0..5.0f64,
            limit in 0.01..2.0f64,
        ) {
            let Deflection { bend, slope } = return_mapping([x, y], limit);
            let length = x.hypot(y);
            prop_assert!(bend[0].hypot(bend[1]) <= limit.min(length) * (1.0 + 1e-12));
            let step = 1e-7;
            let difference = (return_mapping([x + step, y], limit).bend[1] - bend[1]) / step;
            let at_kink = (length - limit).abs() < 1e-6;
            prop_assert!((difference - slope[1][0]).abs() < 1e-2 || at_kink);
        }
    }
}
