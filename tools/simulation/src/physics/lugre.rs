//! LuGre: bristles with the Stribeck effect and viscous friction, with an elastic wire. It depends
//! on speed.
//!
//! Source: C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of
//! systems with friction", IEEE Transactions on Automatic Control 40(3), 1995, equations 1 to 5:
//!
//! ```text
//! z' = v - sigma0 |v| z / g(v),    g(v) = coulomb + (static - coulomb) exp(-(v / stribeck)^2)
//! friction = sigma0 z + sigma1 z' + sigma2 v
//! ```
//!
//! The wire stretches by the friction: travel is bend plus friction, in degrees. Every step is
//! solved for its speed, implicitly, so that long steps are stable.

use super::draw::{Draw, FrictionGrowth, Pair};
use super::hysteresis::Motor;
use crate::ageing::AgeingEffect;

/// Halvings of the speed interval.
const HALVINGS: u32 = 45;

/// Shortest time step, s, so that speeds stay finite.
const MIN_STEP_S: f64 = 1e-6;

/// One motor; forces in degrees of wire stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LuGre {
    coulomb: f64,
    /// Friction at rest, relative to `coulomb`.
    static_factor: f64,
    /// deg/s.
    stribeck: f64,
    growth: FrictionGrowth,
    sigma0: f64,
    /// s.
    sigma1: f64,
    /// s.
    sigma2: f64,
    /// Growth of the friction.
    friction: f64,
    bend: f64,
    z: f64,
}

impl LuGre {
    /// Deflection after a step at speed `v`.
    fn deflection(&self, v: f64, load: f64, dt_s: f64) -> f64 {
        let stribeck = (-(v / self.stribeck).powi(2)).exp();
        let g = self.coulomb * load * (1.0 + (self.static_factor - 1.0) * stribeck);
        (self.z + v * dt_s) / (1.0 + self.sigma0 * v.abs() * dt_s / g)
    }

    /// The speed at which wire and friction balance; `stretch` is that of the wire before.
    fn speed(&self, stretch: f64, load: f64, dt_s: f64) -> f64 {
        let left = |v: f64| {
            let after = self.deflection(v, load, dt_s);
            let bristles = self.sigma0 * after + self.sigma1 * (after - self.z) / dt_s;
            stretch - v * dt_s - bristles - self.sigma2 * v
        };
        let sign = left(0.0).signum();
        // At this speed the wire would be pushed by more than all friction.
        let most = self.sigma0 * self.z.abs() + 2.0 * self.static_factor * self.coulomb * load;
        let (mut low, mut high) = (0.0, (stretch.abs() + most) / dt_s);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if sign * left(sign * middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        sign * low
    }
}

impl Motor for LuGre {
    const LARGEST_STEP_DEG: f64 = 0.05;

    fn draw(draw: &mut Draw, half_gap: f64) -> Self {
        let sigma0 = draw.log_uniform(4.0, 20.0);
        Self {
            coulomb: 0.8 * half_gap,
            static_factor: draw.uniform(1.02, 1.2),
            stribeck: draw.log_uniform(1.0, 6.0),
            growth: FrictionGrowth::draw(draw, 0.4, 0.25),
            sigma0,
            sigma1: draw.uniform(0.001, 0.004) * sigma0,
            sigma2: draw.uniform(0.004, 0.015),
            friction: 1.0,
            bend: 0.0,
            z: 0.0,
        }
    }

    fn advance(&mut self, dt_s: f64, travel: f64, [own, other]: Pair) {
        let dt_s = dt_s.max(MIN_STEP_S);
        let load = self.friction * self.growth.factor(own, other);
        let v = self.speed(travel - self.bend, load, dt_s);
        self.z = self.deflection(v, load, dt_s);
        self.bend += v * dt_s;
    }

    fn bend(&self) -> f64 {
        self.bend
    }

    fn set_ageing(&mut self, effect: &AgeingEffect, motor: usize) {
        self.friction = effect.friction[motor];
    }

    fn half_lost_deg(&self) -> Option<f64> {
        Some(self.coulomb)
    }
}
