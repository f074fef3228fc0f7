//! A change in time.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::change::{Change, Course};

/// A change in progress. It advances on a fixed grid, so that its path does not depend on the
/// time steps of the caller.
#[derive(Debug, Clone)]
pub(super) struct RunningChange {
    pub(super) change: Change,
    /// Time since its start; negative before it.
    time_s: f64,
    random: Pcg64Mcg,
    walked: f64,
}

impl RunningChange {
    /// `seed` determines a random walk.
    pub(super) fn new(change: Change, seed: u64) -> Self {
        Self { time_s: -change.start_s, change, random: Pcg64Mcg::seed_from_u64(seed), walked: 0.0 }
    }

    pub(super) fn step(&mut self, grid_s: f64) {
        self.time_s += grid_s;
        if let Course::RandomWalk { over_s } = self.change.course
            && self.time_s > 0.0
        {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            self.walked += (grid_s / over_s).sqrt() * noise;
        }
    }

    /// The change so far, in the unit of the parameter.
    pub(super) fn value(&self) -> f64 {
        if self.time_s < 0.0 {
            return 0.0;
        }
        self.change.by
            * match self.change.course {
                Course::Step {} => 1.0,
                Course::Ramp { over_s } => (self.time_s / over_s).min(1.0),
                Course::RandomWalk { .. } => self.walked,
                Course::Oscillation { period_s } => (TAU * self.time_s / period_s).sin(),
            }
    }
}
