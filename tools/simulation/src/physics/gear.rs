//! A gear with lost motion and compliance that drives a snake with dry friction.
//!
//! Sources: M. Nordin, P.-O. Gutman, "Controlling mechanical systems with backlash - a survey",
//! Automatica 38, 2002 (an elastic shaft after a dead zone); teeth that stiffen with load, as in
//! the models of strain wave gears since T. D. Tuttle, W. P. Seering, "A nonlinear model of a
//! harmonic drive gear transmission", IEEE Transactions on Robotics and Automation 12(3), 1996.
//!
//! The gap is crossed only where the load changes its flank: where the spring of the snake cannot
//! overcome the friction. So the loop is widest around the straight pose.

use std::f64::consts::TAU;

use super::hysteresis::{Aged, Draw, FrictionGrowth, Motor, Pair, SNAKE_STIFFNESS};

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
    /// Degrees, before the gain.
    at: f64,
}

impl Gear {
    /// Where the snake is when the gear leaves a force of `friction` for it. `gap`: its growth.
    fn balance(&self, travel: f64, friction: f64, gap: f64) -> f64 {
        let pulled = travel + friction;
        let half_gap = gap * self.half_gap;
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
            at: 0.0,
        }
    }

    fn advance(&mut self, _dt_s: f64, travel: f64, [own, other]: Pair, aged: &Aged) {
        let friction = aged.friction * self.friction * self.growth.factor(own, other);
        let pushed = self.balance(travel, friction, aged.gap);
        let pulled = self.balance(travel, -friction, aged.gap);
        self.at = self.at.max(pushed).min(pulled);
    }

    fn bend(&self) -> f64 {
        self.at / self.gain
    }

    fn at(&self) -> f64 {
        self.at
    }

    /// Force on the flanks; 0 inside the gap.
    fn load(&self, travel: f64, aged: &Aged) -> f64 {
        let stretch = travel - self.at;
        let deflection = (stretch.abs() - aged.gap * self.half_gap).max(0.0);
        let flank = self.flanks[usize::from(stretch < 0.0)];
        let force = (flank.stiffness + flank.hardening * deflection) * deflection;
        SNAKE_STIFFNESS * force.copysign(stretch)
    }
}

/// Counts per motor turn of a 256-line encoder.
const TURN_COUNTS: f64 = 1024.0;

/// Sizes of the parts that repeat once and twice a turn, counts.
const SIZES: [[f64; 2]; 2] = [[3.0, 9.0], [1.0, 4.0]];

/// One motor: size, counts, and phase of each part.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wheel([[f64; 2]; 2]);

impl Wheel {
    fn at(&self, turns: f64) -> f64 {
        let part = |[size, phase]: [f64; 2], times: f64| size * (TAU * times * turns + phase).sin();
        part(self.0[0], 1.0) + part(self.0[1], 2.0)
    }
}

/// The transmission error of a gear: wheels that are not round turn too far and too little, once
/// and twice in every turn of the motor.
///
/// Source: D. B. Welbourn, "Fundamental knowledge of gear noise - a survey", Conference on Noise
/// and Vibrations of Engines and Transmissions, 1979 (the term, and its repetition with the turn).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TransmissionError([Wheel; 2]);

impl TransmissionError {
    pub(super) fn draw(draw: &mut Draw) -> Self {
        let mut part = |[low, high]: [f64; 2]| [draw.uniform(low, high), draw.uniform(0.0, TAU)];
        Self([0, 1].map(|_| Wheel(SIZES.map(&mut part))))
    }

    /// Motor positions with the transmission error, counts. At 0 the error is 0.
    pub(super) fn turned(&self, counts: Pair) -> Pair {
        [0, 1].map(|motor: usize| {
            let wheel = &self.0[motor];
            counts[motor] + wheel.at(counts[motor] / TURN_COUNTS) - wheel.at(0.0)
        })
    }
}
