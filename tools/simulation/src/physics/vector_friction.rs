//! Friction that acts on the vector of both wires, like that of a disc which slides on another: a
//! moving motor frees the other.
//!
//! Source: M. A. Krasnosel'skii, A. V. Pokrovskii, "Systems with Hysteresis", Springer, 1989 (the
//! play of a vector): the centre of a circle is pulled by a point that it must not lose. Some
//! circles of different radius give a loop that yields before it slips.

use super::draw::{Draw, FrictionGrowth, Pair};
use super::hysteresis::Hysteresis;
use crate::ageing::AgeingEffect;

/// Radii of the circles relative to half of the lost motion, minimum and maximum of each.
const RADII: [[f64; 2]; 3] = [[0.2, 0.5], [0.7, 1.1], [1.2, 1.6]];

#[derive(Debug, Clone, PartialEq)]
pub(super) struct VectorFriction {
    /// Half of the lost motion, degrees; travel is counted in it.
    lost: Pair,
    growth: FrictionGrowth,
    radii: [f64; 3],
    weights: [f64; 3],
    centres: [Pair; 3],
    /// Growth of the friction, of both motors together.
    friction: f64,
}

impl VectorFriction {
    pub(super) fn draw(draw: &mut Draw, deg_per_count: Pair) -> Self {
        let weights = RADII.map(|_| draw.uniform(0.5, 1.5));
        let sum: f64 = weights.iter().sum();
        Self {
            lost: draw.half_gaps_deg(deg_per_count),
            growth: FrictionGrowth::draw(draw, 0.6, 0.0),
            radii: RADII.map(|[low, high]| draw.uniform(low, high)),
            weights: weights.map(|weight| weight / sum),
            centres: [Pair::default(); 3],
            friction: 1.0,
        }
    }
}

impl Hysteresis for VectorFriction {
    fn largest_step_deg(&self) -> f64 {
        0.05
    }

    fn advance(&mut self, _dt_s: f64, travel: Pair) {
        let [first, second] = self.bend();
        let factor = self.friction * self.growth.factor(first.hypot(second), 0.0);
        let point = [0, 1].map(|motor: usize| travel[motor] / self.lost[motor]);
        for (centre, radius) in self.centres.iter_mut().zip(self.radii) {
            let away = [0, 1].map(|motor: usize| point[motor] - centre[motor]);
            let far = away[0].hypot(away[1]);
            let share = (1.0 - factor * radius / far.max(f64::MIN_POSITIVE)).max(0.0);
            for (centre, away) in centre.iter_mut().zip(away) {
                *centre += share * away;
            }
        }
    }

    fn bend(&self) -> Pair {
        [0, 1].map(|motor: usize| {
            let of = |(centre, weight): (&Pair, f64)| weight * centre[motor];
            self.lost[motor] * self.centres.iter().zip(self.weights).map(of).sum::<f64>()
        })
    }

    fn set_ageing(&mut self, effect: &AgeingEffect) {
        let [first, second] = effect.friction;
        self.friction = 0.5 * (first + second);
    }

    fn half_lost_deg(&self) -> Option<Pair> {
        Some(self.lost)
    }
}
