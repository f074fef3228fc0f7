//! A wire in pieces through guides: every guide holds its piece by capstan friction.
//!
//! Sources: the capstan equation of Euler and Eytelwein, `T_out = T_in exp(-mu wrap)`; in pieces
//! along a tendon: M. Kaneko, T. Yamashita, K. Tanie, "Basic considerations on transmission
//! characteristics for tendon drive robots", ICAR 1991; V. Agrawal, W. J. Peine, B. Yao,
//! "Modeling of transmission characteristics across a cable-conduit system", IEEE Transactions on
//! Robotics 26(5), 2010.
//!
//! The wires of a motor pull against each other with a pretension, so the force on the guides is
//! the sum of both. A reversal frees one piece after the other, starting at the motor; the tip
//! rests until the last one slides.

use super::hysteresis::{Aged, Draw, Motor, Pair};

/// Pieces of a wire.
const PIECES: usize = 6;

/// Over-relaxation of the sweeps; for a chain of this length about the best.
const RELAXATION: f64 = 1.55;

/// Sweeps end when no piece moves further, degrees.
const TOLERANCE_DEG: f64 = 1e-7;

const MAX_SWEEPS: u32 = 200;

/// The wires of one motor; the stiffness of the snake is 1, so forces are in degrees of bend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wire {
    stiffness: f64,
    /// Bend per travel without friction.
    gain: f64,
    pretension: f64,
    friction: f64,
    /// Half of the lost motion when new, degrees.
    half_lost: f64,
    /// Wrap of the straight snake at each guide, radians.
    wrap: [f64; PIECES],
    /// Places of the guided points; the last is the tip.
    places: [f64; PIECES],
}

impl Wire {
    /// Position at the start of a piece: the motor, or the previous guided point.
    fn before(&self, piece: usize, travel: f64) -> f64 {
        match piece {
            0 => travel,
            _ => self.places[piece - 1],
        }
    }

    /// Maximum force that each guide can hold, with the snake bent by `bend_rad` in total.
    fn limits(&self, travel: f64, bend_rad: f64, aged: &Aged) -> [f64; PIECES] {
        let pretension = aged.preload * self.pretension;
        let friction = aged.friction * self.friction;
        std::array::from_fn(|piece| {
            let force = self.stiffness * (self.before(piece, travel) - self.places[piece]);
            // Beyond the pretension the other wire is slack.
            let pressing = (2.0 * pretension).max(pretension + force.abs());
            let wrap = self.wrap[piece] + bend_rad / PIECES as f64;
            pressing * (friction * wrap).exp_m1()
        })
    }
}

impl Motor for Wire {
    const LARGEST_STEP_DEG: f64 = 0.04;

    fn draw(draw: &mut Draw, half_gap: f64) -> Self {
        let half_lost = 0.7 * half_gap;
        let compliance = draw.uniform(0.35, 0.8);
        let pretension = draw.uniform(16.0, 26.0);
        let shares: [f64; PIECES] = std::array::from_fn(|_| draw.uniform(0.4, 1.6));
        let total: f64 = shares.iter().sum();
        let wrap_rad = draw.uniform(2.0, 4.0);
        // Friction stretches the wire by half of its sum, because it adds up from the tip.
        let friction = half_lost / (compliance * pretension * wrap_rad);
        Self {
            stiffness: PIECES as f64 / compliance,
            gain: 1.0 / (1.0 + compliance),
            pretension,
            friction,
            half_lost,
            wrap: shares.map(|share| wrap_rad * share / total),
            places: [0.0; PIECES],
        }
    }

    /// Solves the balance: a piece moves until its guide can hold the remaining force.
    fn advance(&mut self, _dt_s: f64, travel: f64, [first, second]: Pair, aged: &Aged) {
        let bend_rad = first.hypot(second).to_radians().min(2.0);
        let limits = self.limits(travel, bend_rad, aged);
        for _ in 0..MAX_SWEEPS {
            let mut moved = 0.0_f64;
            for (piece, limit) in limits.iter().enumerate() {
                let before = self.before(piece, travel);
                let here = self.places[piece];
                let (onward, stiffness) = match self.places.get(piece + 1) {
                    Some(next) => (self.stiffness * (here - next), 2.0 * self.stiffness),
                    None => (here, self.stiffness + 1.0),
                };
                let force = self.stiffness * (before - here) - onward;
                let left = force - force.clamp(-limit, *limit);
                let step = RELAXATION * left / stiffness;
                self.places[piece] += step;
                moved = moved.max(step.abs());
            }
            if moved < TOLERANCE_DEG {
                return;
            }
        }
    }

    fn bend(&self) -> f64 {
        self.places[PIECES - 1] / self.gain
    }

    fn half_lost_deg(&self) -> Option<f64> {
        Some(self.half_lost)
    }
}
