//! Parameters at random, by a seed.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::pair::Pair;

/// Half of the lost motion of a motor, counts: what robots of this kind show.
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
