//! Transmissions with friction: a gear, also with an error that repeats; a wire in pieces.

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

/// The gear of one motor, with lost motion and compliance, and its snake of stiffness 1.
///
/// Sources: M. Nordin, P.-O. Gutman, "Controlling mechanical systems with backlash - a survey",
/// Automatica 38, 2002 (an elastic shaft after a dead zone); teeth that stiffen with load, as in
/// the models of strain wave gears since T. D. Tuttle, W. P. Seering, "A nonlinear model of a
/// harmonic drive gear transmission", IEEE Transactions on Robotics and Automation 12(3), 1996.
///
/// The gap is crossed only where the load changes its flank: where the spring of the snake cannot
/// overcome the friction. So the loop is widest around the straight pose.
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

/// The transmission error of a gear: wheels out of round err once and twice in every turn.
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

/// Pieces of a wire.
const PIECES: usize = 6;
/// Over-relaxation of the sweeps; for a chain of this length about the best.
const RELAXATION: f64 = 1.55;
/// Sweeps end when no piece moves further, degrees.
const TOLERANCE_DEG: f64 = 1e-7;
const MAX_SWEEPS: u32 = 200;

/// A wire in pieces through guides: every guide holds its piece by capstan friction.
///
/// Sources: the capstan equation of Euler and Eytelwein, `T_out = T_in exp(-mu wrap)`; in pieces
/// along a tendon: M. Kaneko, T. Yamashita, K. Tanie, "Basic considerations on transmission
/// characteristics for tendon drive robots", ICAR 1991; V. Agrawal, W. J. Peine, B. Yao,
/// "Modeling of transmission characteristics across a cable-conduit system", IEEE Transactions on
/// Robotics 26(5), 2010.
///
/// The wires of a motor pull against each other with a pretension, so the force on the guides is
/// the sum of both. A reversal frees one piece after the other, starting at the motor; the tip
/// rests until the last one slides.
///
/// The stiffness of the snake is 1, so forces are in degrees of bend.
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
