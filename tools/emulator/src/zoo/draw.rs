//! Parameters at random, by a seed.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::pair::Pair;

/// Half of the lost motion of a motor, counts: what robots of this kind show.
const HALF_GAP_COUNTS: [f64; 2] = [20.0, 120.0];

/// A source of parameters.
#[derive(Debug)]
pub(super) struct Draw(Pcg64Mcg);

impl Draw {
    pub(super) fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    pub(super) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Every factor is equally likely.
    pub(super) fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.0.random::<f64>())
    }

    /// One for each motor.
    pub(super) fn both(&mut self, low: f64, high: f64) -> Pair {
        [0, 1].map(|_| self.uniform(low, high))
    }

    /// Half of the lost motion of each motor, degrees. The motors are made alike, so they share
    /// the size and differ by a third at most.
    pub(super) fn half_gaps_deg(&mut self, deg_per_count: Pair) -> Pair {
        let [low, high] = HALF_GAP_COUNTS;
        let counts = self.log_uniform(low / 0.8, high / 1.2);
        deg_per_count.map(|gain| gain * counts * self.uniform(0.8, 1.2))
    }
}
