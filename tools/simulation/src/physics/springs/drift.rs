//! Slow random changes of friction and the zero.
//!
//! Both are Ornstein-Uhlenbeck processes with a known standard deviation in the long run. They
//! advance on a fixed time grid, so the path does not depend on the time steps of the caller.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::config::DriftConfig;

/// The grid, seconds; a power of two, so that sums of steps are exact.
const GRID_S: f64 = 0.125;

/// Longest simulated pause: after it the process is independent of its past.
const MAX_PAUSE_S: f64 = 36_000.0;

#[derive(Debug, Clone)]
pub(super) struct SlowChange {
    config: DriftConfig,
    random: Pcg64Mcg,
    /// Time since the last point of the grid.
    pending_s: f64,
    /// Zero of pitch and yaw, degrees.
    offset_deg: [f64; 2],
    /// Relative change of the friction.
    friction: f64,
}

impl SlowChange {
    /// Starts at 0.
    pub(super) fn new(config: &DriftConfig, seed: u64) -> Self {
        Self {
            config: config.clone(),
            random: Pcg64Mcg::seed_from_u64(seed),
            pending_s: 0.0,
            offset_deg: [0.0; 2],
            friction: 0.0,
        }
    }

    /// Advances by `dt_s` seconds.
    pub(super) fn step(&mut self, dt_s: f64) {
        self.pending_s = (self.pending_s + dt_s).min(MAX_PAUSE_S);
        while self.pending_s >= GRID_S {
            self.pending_s -= GRID_S;
            let (config, random) = (&self.config, &mut self.random);
            for offset in &mut self.offset_deg {
                advance(offset, config.offset_deg, config.offset_time_s, random);
            }
            advance(&mut self.friction, config.friction, config.friction_time_s, random);
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
}

/// One step of the grid, exact for the process: `x <- a x + deviation sqrt(1 - a^2) noise`,
/// `a = exp(-dt / time)`.
fn advance(value: &mut f64, deviation: f64, time_s: f64, random: &mut Pcg64Mcg) {
    let noise: f64 = StandardNormal.sample(random);
    let keep = (-GRID_S / time_s).exp();
    *value = keep * *value + deviation * (1.0 - keep * keep).sqrt() * noise;
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
    fn the_deviation_is_the_configured_one() {
        let mut drift = SlowChange::new(&config(), 3);
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
        let (mut coarse, mut fine) = (SlowChange::new(&config(), 7), SlowChange::new(&config(), 7));
        coarse.step(64.0);
        for _ in 0..64 * 64 {
            fine.step(1.0 / 64.0);
        }
        assert_eq!(coarse.offset_deg(), fine.offset_deg());
        assert!(coarse.offset_deg()[0] != 0.0);
    }
}
