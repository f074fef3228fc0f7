//! Shared by the physics: pairs of values, random parameters from a seed, and friction that grows
//! with the bend, because the wires press harder on their guides.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Half of the lost motion of a motor, counts, as on robots of this kind.
const HALF_GAP_COUNTS: [f64; 2] = [20.0, 110.0];

/// Spreads the seeds of one physics away from those of another (the golden ratio in 64 bits).
const SPREAD: u64 = 0x9E37_79B9_7F4A_7C15;

#[derive(Debug)]
pub(super) struct Draw(Pcg64Mcg);

impl Draw {
    /// Equal seeds of different streams have nothing in common.
    pub(super) fn new(seed: u64, stream: u64) -> Self {
        let mixed = seed ^ SPREAD.wrapping_mul(stream + 1);
        Self(Pcg64Mcg::seed_from_u64(mixed))
    }

    pub(super) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Every factor is equally likely.
    pub(super) fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.0.random::<f64>())
    }

    pub(super) fn both(&mut self, low: f64, high: f64) -> Pair {
        [0, 1].map(|_| self.uniform(low, high))
    }

    /// Half of the lost motion of each motor, degrees. The motors are made alike, so they share
    /// the size and differ by a third at most.
    pub(super) fn half_gaps_deg(&mut self, deg_per_count: Pair) -> Pair {
        let [low, high] = HALF_GAP_COUNTS;
        let counts = self.uniform(low / 0.8, high / 1.2);
        deg_per_count.map(|gain| gain * counts * self.uniform(0.8, 1.2))
    }
}

/// Bend at which the growth is counted, degrees.
const FULL_BEND_DEG: f64 = 40.0;

/// Relative friction growth of a motor at full bend, by this motor and by the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrictionGrowth {
    own: f64,
    other: f64,
}

impl FrictionGrowth {
    /// Draws the growth by either motor, up to these limits.
    pub(super) fn draw(draw: &mut Draw, own: f64, other: f64) -> Self {
        Self { own: draw.uniform(0.0, own), other: draw.uniform(0.0, other) }
    }

    /// Factor on the friction at these bends of this motor and the other, degrees.
    pub(super) fn factor(&self, own: f64, other: f64) -> f64 {
        1.0 + (self.own * own.abs() + self.other * other.abs()) / FULL_BEND_DEG
    }
}

/// Pitch and yaw, or motor 0 and motor 1.
pub(super) type Pair = [f64; 2];

pub(super) fn dot(a: Pair, b: Pair) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn add(a: Pair, b: Pair) -> Pair {
    [a[0] + b[0], a[1] + b[1]]
}

pub(super) fn subtract(a: Pair, b: Pair) -> Pair {
    [a[0] - b[0], a[1] - b[1]]
}

/// Interpolates from one pair to another.
pub(super) fn between(from: Pair, to: Pair, share: f64) -> Pair {
    [0, 1].map(|i: usize| from[i] + share * (to[i] - from[i]))
}
