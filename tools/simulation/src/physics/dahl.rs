//! Dahl: friction that grows with the travel since the last reversal, up to a limit, with an
//! elastic wire.
//!
//! Source: P. R. Dahl, "A solid friction model", The Aerospace Corporation, TOR-158(3107-18),
//! 1968: `dF/dx = sigma (1 - F / limit sgn x')^i`. The wire stretches by the friction: travel is
//! bend plus `F`, both in degrees. The limit grows with the load of both motors.

use super::draw::{Draw, FrictionGrowth, Pair, subtract};
use super::hysteresis::Hysteresis;
use crate::ageing::AgeingEffect;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Axis {
    /// Friction that stops growing, degrees of wire stretch.
    limit: f64,
    growth: FrictionGrowth,
    /// Relative difference between the directions.
    asymmetry: f64,
    /// Initial stiffness, relative to the wire.
    sigma: f64,
    exponent: f64,
}

impl Axis {
    fn draw(draw: &mut Draw, limit: f64) -> Self {
        Self {
            limit,
            growth: FrictionGrowth::draw(draw, 0.5, 0.3),
            asymmetry: draw.uniform(-0.2, 0.2),
            sigma: draw.log_uniform(3.0, 15.0),
            exponent: draw.uniform(0.6, 1.4),
        }
    }

    fn limit(&self, own: f64, other: f64, sign: f64) -> f64 {
        self.limit * self.growth.factor(own, other) * (1.0 + sign * self.asymmetry)
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Dahl {
    axes: [Axis; 2],
    /// Growth of the limits.
    friction: Pair,
    travel: Pair,
    bend: Pair,
}

impl Dahl {
    pub(super) fn draw(draw: &mut Draw, deg_per_count: Pair) -> Self {
        let gaps = draw.half_gaps_deg(deg_per_count);
        Self {
            axes: gaps.map(|limit| Axis::draw(draw, 0.8 * limit)),
            friction: [1.0; 2],
            travel: Pair::default(),
            bend: Pair::default(),
        }
    }
}

impl Hysteresis for Dahl {
    fn largest_step_deg(&self) -> f64 {
        0.02
    }

    fn advance(&mut self, _dt_s: f64, travel: Pair) {
        let (moved, before) = (subtract(travel, self.travel), self.bend);
        for motor in 0..2 {
            if moved[motor] == 0.0 {
                continue;
            }
            let axis = &self.axes[motor];
            let sign = moved[motor].signum();
            let limit = self.friction[motor] * axis.limit(before[motor], before[1 - motor], sign);
            let friction = self.travel[motor] - before[motor];
            let left = (1.0 - sign * friction / limit).max(0.0);
            let stiffness = axis.sigma * left.powf(axis.exponent);
            self.bend[motor] += moved[motor] / (1.0 + stiffness);
        }
        self.travel = travel;
    }

    fn bend(&self) -> Pair {
        self.bend
    }

    fn set_ageing(&mut self, effect: &AgeingEffect) {
        self.friction = effect.friction;
    }

    fn half_lost_deg(&self) -> Option<Pair> {
        Some(self.axes.map(|axis| axis.limit))
    }
}
