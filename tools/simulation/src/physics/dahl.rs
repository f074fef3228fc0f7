//! Dahl: friction that grows with the travel since the last reversal, up to a limit, with an
//! elastic wire.
//!
//! Source: P. R. Dahl, "A solid friction model", The Aerospace Corporation, TOR-158(3107-18),
//! 1968: `dF/dx = sigma (1 - F / limit sgn x')^i`. The wire stretches by the friction: travel is
//! bend plus `F`, both in degrees. The limit grows with the load of both motors.

use super::draw::{Draw, FrictionGrowth, Pair};
use super::hysteresis::Motor;
use crate::ageing::AgeingEffect;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dahl {
    /// Friction that stops growing, degrees of wire stretch.
    limit: f64,
    growth: FrictionGrowth,
    /// Relative difference between the directions.
    asymmetry: f64,
    /// Initial stiffness, relative to the wire.
    sigma: f64,
    exponent: f64,
    /// Growth of the limit.
    friction: f64,
    travel: f64,
    bend: f64,
}

impl Dahl {
    fn limit(&self, [own, other]: Pair, sign: f64) -> f64 {
        self.limit * self.growth.factor(own, other) * (1.0 + sign * self.asymmetry)
    }
}

impl Motor for Dahl {
    const LARGEST_STEP_DEG: f64 = 0.02;

    fn draw(draw: &mut Draw, half_gap: f64) -> Self {
        Self {
            limit: 0.8 * half_gap,
            growth: FrictionGrowth::draw(draw, 0.5, 0.3),
            asymmetry: draw.uniform(-0.2, 0.2),
            sigma: draw.log_uniform(3.0, 15.0),
            exponent: draw.uniform(0.6, 1.4),
            friction: 1.0,
            travel: 0.0,
            bend: 0.0,
        }
    }

    fn advance(&mut self, _dt_s: f64, travel: f64, before: Pair) {
        let moved = travel - self.travel;
        if moved != 0.0 {
            let sign = moved.signum();
            let limit = self.friction * self.limit(before, sign);
            let left = (1.0 - sign * (self.travel - self.bend) / limit).max(0.0);
            self.bend += moved / (1.0 + self.sigma * left.powf(self.exponent));
        }
        self.travel = travel;
    }

    fn bend(&self) -> f64 {
        self.bend
    }

    fn set_ageing(&mut self, effect: &AgeingEffect, motor: usize) {
        self.friction = effect.friction[motor];
    }

    fn half_lost_deg(&self) -> Option<f64> {
        Some(self.limit)
    }
}
