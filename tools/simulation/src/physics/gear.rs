//! A gear with lost motion and compliance that drives a snake with dry friction.
//!
//! Sources: M. Nordin, P.-O. Gutman, "Controlling mechanical systems with backlash - a survey",
//! Automatica 38, 2002 (an elastic shaft after a dead zone); teeth that stiffen with load, as in
//! the models of strain wave gears since T. D. Tuttle, W. P. Seering, "A nonlinear model of a
//! harmonic drive gear transmission", IEEE Transactions on Robotics and Automation 12(3), 1996.
//!
//! The gap is crossed only where the load changes its flank: where the spring of the snake cannot
//! overcome the friction. So the loop is widest around the straight pose.

use super::draw::{Draw, FrictionGrowth, Pair};
use super::hysteresis::{Motor, SNAKE_STIFFNESS};
use crate::ageing::AgeingEffect;

/// A flank: the force at a deflection `e` is `stiffness e + hardening e^2`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Flank {
    stiffness: f64,
    hardening: f64,
}

impl Flank {
    /// Deflection at which flank and snake together take up a travel `beyond` the gap.
    fn deflection(&self, beyond: f64) -> f64 {
        let linear = self.stiffness + 1.0;
        // The root of the quadratic in the form that has no cancellation.
        2.0 * beyond / (linear + (linear * linear + 4.0 * self.hardening * beyond).sqrt())
    }
}

/// The gear of one motor and what it drives; the stiffness of the snake is 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gear {
    /// Half of the gap, degrees.
    half_gap: f64,
    /// For rising and for falling load.
    flanks: [Flank; 2],
    friction: f64,
    growth: FrictionGrowth,
    /// Bend per travel of one flank.
    gain: f64,
    /// Growth of the gap and of the friction.
    gap_factor: f64,
    friction_factor: f64,
    /// Degrees, before the gain.
    at: f64,
}

impl Gear {
    /// Where the snake is when the gear leaves a force of `friction` for it.
    fn balance(&self, travel: f64, friction: f64) -> f64 {
        let pulled = travel + friction;
        let half_gap = self.gap_factor * self.half_gap;
        if pulled.abs() <= half_gap {
            return -friction;
        }
        let flank = self.flanks[usize::from(pulled < 0.0)];
        let deflection = flank.deflection(pulled.abs() - half_gap);
        travel - (half_gap + deflection).copysign(pulled)
    }
}

impl Motor for Gear {
    const LARGEST_STEP_DEG: f64 = 0.05;

    fn draw(draw: &mut Draw, half_lost: f64) -> Self {
        let stiffness = draw.uniform(3.0, 7.0);
        let flanks = [0, 1].map(|_| Flank {
            stiffness: stiffness * draw.uniform(0.85, 1.15),
            hardening: draw.uniform(0.0, 0.25),
        });
        Self {
            half_gap: half_lost * draw.uniform(0.25, 0.5),
            flanks,
            friction: half_lost * draw.uniform(0.5, 0.7) * stiffness,
            growth: FrictionGrowth::draw(draw, 0.5, 0.3),
            gain: stiffness / (stiffness + 1.0),
            gap_factor: 1.0,
            friction_factor: 1.0,
            at: 0.0,
        }
    }

    fn advance(&mut self, _dt_s: f64, travel: f64, [own, other]: Pair) {
        let friction = self.friction_factor * self.friction * self.growth.factor(own, other);
        let pushed = self.balance(travel, friction);
        let pulled = self.balance(travel, -friction);
        self.at = self.at.max(pushed).min(pulled);
    }

    fn bend(&self) -> f64 {
        self.at / self.gain
    }

    fn at(&self) -> f64 {
        self.at
    }

    fn set_ageing(&mut self, effect: &AgeingEffect, motor: usize) {
        self.gap_factor = effect.gap[motor];
        self.friction_factor = effect.friction[motor];
    }

    /// Force on the flanks; 0 inside the gap.
    fn load(&self, travel: f64) -> f64 {
        let stretch = travel - self.at;
        let deflection = (stretch.abs() - self.gap_factor * self.half_gap).max(0.0);
        let flank = self.flanks[usize::from(stretch < 0.0)];
        let force = (flank.stiffness + flank.hardening * deflection) * deflection;
        SNAKE_STIFFNESS * force.copysign(stretch)
    }
}
