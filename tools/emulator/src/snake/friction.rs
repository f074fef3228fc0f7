//! Friction of one segment: how much it can hold under the tension of the wires, and how it holds.

use super::config::FrictionConfig;
use super::law::{Force, slip};
use super::{MAX_BRISTLES, Pair, dot};

/// The snake cannot bend further than its stops, radians; without a bound a wild input would
/// overflow the rope formula.
const LARGEST_BEND_RAD: f64 = 2.0;

/// Break-away forces, each as if all friction was of that kind.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Load {
    /// Of the joints that all wires press on.
    shared: f64,
    /// Of the guides of each motor's own wires.
    own: Pair,
}

impl Load {
    /// By the rope formula: `base + sum over wires of tension * (exp(coefficient * wrap) - 1)`.
    /// `pulls` are the tensions, by motor and direction. The two wire pairs press at right angles,
    /// so their loads add like legs of a triangle.
    pub(super) fn new(
        config: &FrictionConfig,
        pulls: [[Force; 2]; 2],
        bend: Pair,
        factor: f64,
    ) -> Self {
        let bent_rad = bend[0].hypot(bend[1]).to_radians().min(LARGEST_BEND_RAD);
        let rope = |pull: Force, wrap_deg: f64| {
            pull.value * (config.coefficient * (wrap_deg.to_radians() + bent_rad)).exp_m1()
        };
        let load = [0, 1].map(|motor: usize| {
            pulls[motor]
                .iter()
                .zip(config.wrap_deg[motor])
                .map(|(pull, wrap)| rope(*pull, wrap))
                .sum::<f64>()
        });
        Self {
            shared: factor * (config.base + load[0].hypot(load[1])),
            own: load.map(|load| factor * (config.base + load)),
        }
    }
}

/// The bristles of one segment, degrees of bend.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Bristles {
    /// In the joints, by kind: pitch and yaw, limited by a circle.
    shared: [Pair; MAX_BRISTLES],
    /// In the guides, by kind: motor 0 and motor 1, each limited by itself.
    own: [Pair; MAX_BRISTLES],
}

/// What the bristles do after a movement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hold {
    /// The bristles after slipping.
    pub bristles: Bristles,
    /// Their force, pitch and yaw.
    pub force: Pair,
    /// The slope of that force, symmetric.
    pub slope: [Pair; 2],
}

impl Bristles {
    /// Moves the segment by `moved`. `share` scales the break-away forces for this segment; `axes`
    /// are the directions of the motors in pitch and yaw.
    pub(super) fn hold(
        &self,
        config: &FrictionConfig,
        load: &Load,
        share: f64,
        axes: [Pair; 2],
        moved: Pair,
    ) -> Hold {
        let mut hold = Hold {
            bristles: *self,
            force: [0.0; 2],
            slope: [[0.0; 2]; 2],
        };
        for (kind, law) in config.bristles.iter().enumerate() {
            let reach = |breakaway: f64| share * breakaway * law.share / law.stiffness;
            let held = self.shared[kind];
            let joint = slip([held[0] + moved[0], held[1] + moved[1]], reach(load.shared));
            hold.bristles.shared[kind] = joint.bend;
            hold.add(law.stiffness * config.shared, joint.bend, joint.slope);
            for (motor, axis) in axes.into_iter().enumerate() {
                let guide = slip(
                    [self.own[kind][motor] + dot(axis, moved), 0.0],
                    reach(load.own[motor]),
                );
                hold.bristles.own[kind][motor] = guide.bend[0];
                let (bend, slope) = (guide.bend[0], guide.slope[0][0]);
                hold.add(
                    law.stiffness * (1.0 - config.shared),
                    axis.map(|along| bend * along),
                    axis.map(|along| axis.map(|across| slope * along * across)),
                );
            }
        }
        hold
    }

    /// All bristles keep the share `left` of their bend.
    pub(super) fn creep(&mut self, left: f64) {
        let bends = self
            .shared
            .as_flattened_mut()
            .iter_mut()
            .chain(self.own.as_flattened_mut());
        bends.for_each(|bend| *bend *= left);
    }
}

impl Hold {
    fn add(&mut self, stiffness: f64, bend: Pair, slope: [Pair; 2]) {
        self.force
            .iter_mut()
            .zip(bend)
            .for_each(|(force, bend)| *force += stiffness * bend);
        let slopes = self
            .slope
            .as_flattened_mut()
            .iter_mut()
            .zip(slope.as_flattened());
        slopes.for_each(|(sum, slope)| *sum += stiffness * slope);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXES: [Pair; 2] = [[1.0, 0.0], [0.0, 1.0]];

    fn config(shared: f64) -> FrictionConfig {
        FrictionConfig {
            shared,
            ..crate::snake::tests::config("steel").friction
        }
    }

    fn pulls(tension: f64) -> [[Force; 2]; 2] {
        [
            [
                Force {
                    value: tension,
                    slope: 1.0,
                },
                Force::default(),
            ],
            [Force::default(); 2],
        ]
    }

    #[test]
    fn the_break_away_force_grows_with_tension_and_bend() {
        let load = |tension: f64, bend: f64| {
            Load::new(&config(0.0), pulls(tension), [bend, 0.0], 1.0).own[0]
        };
        assert!(load(5.0, 0.0) > 1.1 * load(0.0, 0.0));
        assert!(load(5.0, 40.0) > 1.1 * load(5.0, 0.0));
        assert_eq!(load(0.0, 40.0), load(0.0, 0.0));
    }

    #[test]
    fn a_motor_that_moves_frees_the_other_only_where_friction_is_shared() {
        for (shared, frees) in [(1.0, true), (0.0, false)] {
            let config = config(shared);
            let load = Load::new(&config, pulls(0.0), [0.0; 2], 1.0);
            let first = Bristles::default().hold(&config, &load, 1.0, AXES, [5.0, 0.0]);
            let second = first.bristles.hold(&config, &load, 1.0, AXES, [0.0, 5.0]);
            assert_eq!(
                second.force[0] < 0.5 * first.force[0],
                frees,
                "{first:?} {second:?}"
            );
        }
    }
}
