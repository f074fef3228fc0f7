//! The camera: angles of the snake at a steady rate, with noise, some time after the exposure.

use std::collections::VecDeque;

use i2ris::ipc::payload::ExternalPosition;
use i2ris::units::Nanos;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// A camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraConfig {
    /// Pictures per second.
    pub rate_hz: f64,
    /// Standard deviation of a measured angle, degrees.
    pub noise_deg: f64,
    /// From the exposure to the delivery, milliseconds.
    pub latency_ms: u64,
}

impl Default for CameraConfig {
    fn default() -> Self {
        Self {
            rate_hz: 30.0,
            noise_deg: 0.05,
            latency_ms: 40,
        }
    }
}

/// A camera at work. Time is an argument; what it needs of the world is asked for at the exposure.
#[derive(Debug)]
pub struct Camera {
    config: CameraConfig,
    random: Pcg64Mcg,
    period: Nanos,
    next_exposure: Nanos,
    sequence: u64,
    /// Taken, but not delivered yet.
    pending: VecDeque<ExternalPosition>,
}

impl Camera {
    /// A camera that takes its first picture at `now`. `seed` determines the noise.
    #[must_use]
    pub fn new(config: &CameraConfig, seed: u64, now: Nanos) -> Self {
        let rate_hz = if config.rate_hz > 0.0 {
            config.rate_hz.min(1000.0)
        } else {
            1.0
        };
        Self {
            config: config.clone(),
            random: Pcg64Mcg::seed_from_u64(seed),
            period: Nanos((1e9 / rate_hz) as u64),
            next_exposure: now,
            sequence: 0,
            pending: VecDeque::new(),
        }
    }

    /// When there is something to do next: a picture to take or one to deliver.
    #[must_use]
    pub fn next(&self) -> Nanos {
        let delivery = self.pending.front().map(|picture| self.delivery(picture));
        delivery.map_or(self.next_exposure, |delivery| {
            delivery.min(self.next_exposure)
        })
    }

    /// Whether it is time for a picture.
    #[must_use]
    pub fn wants_picture(&self, now: Nanos) -> bool {
        now >= self.next_exposure
    }

    /// Takes a picture of these angles (pitch and yaw, degrees) that are true at `stamp`. Exposures
    /// that were missed meanwhile are left out.
    pub fn take_picture(&mut self, stamp: Nanos, angles_deg: [f64; 2]) {
        let noise = self.config.noise_deg.to_radians();
        let mut position = [0.0; 3];
        for (position, angle) in position.iter_mut().zip(angles_deg) {
            let kick: f64 = StandardNormal.sample(&mut self.random);
            *position = angle.to_radians() + noise * kick;
        }
        self.sequence += 1;
        self.pending.push_back(ExternalPosition {
            sequence: self.sequence,
            stamp_ns: stamp.0,
            position,
            deviation: [noise, noise, 0.0],
            quality: 1.0,
            count: 2,
            flags: ExternalPosition::VALID,
        });
        let missed = (stamp - self.next_exposure).0 / self.period.0;
        self.next_exposure = self.next_exposure + Nanos(self.period.0 * (missed + 1));
    }

    /// The next picture whose time of delivery has come.
    pub fn deliver(&mut self, now: Nanos) -> Option<ExternalPosition> {
        let due = self
            .pending
            .front()
            .is_some_and(|picture| self.delivery(picture) <= now);
        if due { self.pending.pop_front() } else { None }
    }

    fn delivery(&self, picture: &ExternalPosition) -> Nanos {
        Nanos(picture.stamp_ns) + Nanos::from_millis(self.config.latency_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(config: &CameraConfig, until_ms: u64) -> Vec<(Nanos, ExternalPosition)> {
        let mut camera = Camera::new(config, 1, Nanos::ZERO);
        let mut delivered = Vec::new();
        loop {
            let now = camera.next();
            if now > Nanos::from_millis(until_ms) {
                return delivered;
            }
            if camera.wants_picture(now) {
                camera.take_picture(now, [10.0, -20.0]);
            }
            delivered.extend(camera.deliver(now).map(|picture| (now, picture)));
        }
    }

    #[test]
    fn pictures_come_at_the_rate_and_after_the_latency() {
        let delivered = run(&CameraConfig::default(), 10_000);
        assert!(
            (298..=300).contains(&delivered.len()),
            "{}",
            delivered.len()
        );
        for (number, (now, picture)) in delivered.iter().enumerate() {
            assert_eq!(picture.sequence, number as u64 + 1);
            assert_eq!(now.0 - picture.stamp_ns, 40_000_000);
        }
    }

    #[test]
    fn the_noise_is_the_configured_one() {
        let delivered = run(&CameraConfig::default(), 60_000);
        let squares: f64 = delivered
            .iter()
            .map(|(_, picture)| (picture.position[1].to_degrees() + 20.0).powi(2))
            .sum();
        let spread = (squares / delivered.len() as f64).sqrt();
        assert!((0.045..0.055).contains(&spread), "{spread}");
    }

    #[test]
    fn a_stall_leaves_pictures_out_and_causes_no_burst() {
        let mut camera = Camera::new(
            &CameraConfig {
                rate_hz: 10.0,
                ..CameraConfig::default()
            },
            1,
            Nanos::ZERO,
        );
        camera.take_picture(Nanos::from_millis(550), [0.0; 2]);
        assert!(!camera.wants_picture(Nanos::from_millis(599)));
        assert!(camera.wants_picture(Nanos::from_millis(600)));
    }
}
