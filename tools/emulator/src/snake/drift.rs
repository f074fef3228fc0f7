//! What wanders while the snake works: the zero of the picture and the strength of the friction.
//!
//! Both are Ornstein-Uhlenbeck processes: random walks on a soft leash, with a known spread in the
//! long run. They advance on a fixed grid of time, so that the path does not depend on how time is
//! cut into steps.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::config::DriftConfig;

/// The grid, seconds; a power of two, so that adding steps up is exact.
const GRID_S: f64 = 0.125;

/// After a pause longer than this the leash has forgotten everything: no use in walking through it.
const LONGEST_PAUSE_S: f64 = 36_000.0;

/// The wandering of one snake.
#[derive(Debug, Clone)]
pub(super) struct Drift {
    config: DriftConfig,
    random: Pcg64Mcg,
    /// Time since the last point of the grid.
    pending_s: f64,
    /// Zero of pitch and yaw, degrees.
    offset_deg: [f64; 2],
    /// Friction above normal, as a share.
    friction: f64,
}

impl Drift {
    /// Starts at the middle, so that a fresh snake is at zero.
    pub(super) fn new(config: &DriftConfig, seed: u64) -> Self {
        Self {
            config: config.clone(),
            random: Pcg64Mcg::seed_from_u64(seed),
            pending_s: 0.0,
            offset_deg: [0.0; 2],
            friction: 0.0,
        }
    }

    /// Lets time pass.
    pub(super) fn step(&mut self, dt_s: f64) {
        self.pending_s = (self.pending_s + dt_s).min(LONGEST_PAUSE_S);
        while self.pending_s >= GRID_S {
            self.pending_s -= GRID_S;
            for axis in 0..2 {
                let kick = self.kick();
                let (spread, time) = (self.config.offset_deg, self.config.offset_time_s);
                self.offset_deg[axis] = wander(self.offset_deg[axis], spread, time, kick);
            }
            let kick = self.kick();
            self.friction = wander(
                self.friction,
                self.config.friction,
                self.config.friction_time_s,
                kick,
            );
        }
    }

    /// Zero of pitch and yaw, degrees.
    pub(super) fn offset_deg(&self) -> [f64; 2] {
        self.offset_deg
    }

    /// The factor on all friction, near 1.
    pub(super) fn friction_factor(&self) -> f64 {
        (1.0 + self.friction).max(0.1)
    }

    fn kick(&mut self) -> f64 {
        StandardNormal.sample(&mut self.random)
    }
}

/// One step of the grid, exact for the process: `x <- a x + spread sqrt(1 - a^2) kick`,
/// `a = exp(-dt / time)`.
fn wander(value: f64, spread: f64, time_s: f64, kick: f64) -> f64 {
    let keep = (-GRID_S / time_s).exp();
    keep * value + spread * (1.0 - keep * keep).sqrt() * kick
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> DriftConfig {
        DriftConfig {
            offset_deg: 0.1,
            offset_time_s: 10.0,
            friction: 0.02,
            friction_time_s: 10.0,
            creep_time_s: 100.0,
        }
    }

    #[test]
    fn the_spread_is_the_configured_one() {
        let mut drift = Drift::new(&config(), 3);
        let mut sum = 0.0;
        for _ in 0..20_000 {
            drift.step(1.0);
            sum += drift.offset_deg()[0].powi(2);
        }
        let spread = (sum / 20_000.0).sqrt();
        assert!((0.09..0.11).contains(&spread), "{spread}");
    }

    #[test]
    fn the_path_does_not_depend_on_the_steps() {
        let (mut coarse, mut fine) = (Drift::new(&config(), 7), Drift::new(&config(), 7));
        coarse.step(64.0);
        (0..64 * 64).for_each(|_| fine.step(1.0 / 64.0));
        assert_eq!(coarse.offset_deg(), fine.offset_deg());
        assert!(coarse.offset_deg()[0] != 0.0);
    }
}
