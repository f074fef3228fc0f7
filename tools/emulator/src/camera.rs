//! The camera: angles of the snake at a fixed rate, with noise and latency.

use std::collections::VecDeque;

use i2ris::ipc::payload::ExternalPosition;
use i2ris::units::Nanos;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// A camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraConfig {
    /// Frames per second.
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

/// A running camera. Time is an argument; the caller measures the angles at each exposure.
#[derive(Debug)]
pub struct Camera {
    config: CameraConfig,
    random: Pcg64Mcg,
    period: Nanos,
    next_exposure: Nanos,
    sequence: u64,
    /// Captured, but not delivered yet.
    pending: VecDeque<ExternalPosition>,
}

impl Camera {
    /// A camera whose first exposure is at `now`. `seed` determines the noise.
    #[must_use]
    pub fn new(config: &CameraConfig, seed: u64, now: Nanos) -> Self {
        let is_valid = config.rate_hz > 0.0;
        let rate_hz = if is_valid {
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

    /// The instant of the next exposure or delivery.
    #[must_use]
    pub fn next_due(&self) -> Nanos {
        let delivery = self.pending.front().map(|frame| self.delivery(frame));
        self.next_exposure
            .min(delivery.unwrap_or(self.next_exposure))
    }

    /// Whether an exposure is due.
    #[must_use]
    pub fn is_exposure_due(&self, now: Nanos) -> bool {
        now >= self.next_exposure
    }

    /// Captures the true angles (pitch and yaw, degrees) at `stamp`. Missed exposures are skipped.
    pub fn capture(&mut self, stamp: Nanos, angles_deg: [f64; 2]) {
        let deviation = self.config.noise_deg.to_radians();
        let mut position = [0.0; 3];
        for (position, angle) in position.iter_mut().zip(angles_deg) {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            *position = angle.to_radians() + deviation * noise;
        }
        self.sequence += 1;
        self.pending.push_back(ExternalPosition {
            sequence: self.sequence,
            stamp_ns: stamp.0,
            position,
            deviation: [deviation, deviation, 0.0],
            quality: 1.0,
            count: 2,
            flags: ExternalPosition::VALID,
        });
        let missed = (stamp - self.next_exposure).0 / self.period.0;
        self.next_exposure = self.next_exposure + Nanos(self.period.0 * (missed + 1));
    }

    /// The next frame whose delivery is due.
    pub fn deliver(&mut self, now: Nanos) -> Option<ExternalPosition> {
        let next = self.pending.front()?;
        if self.delivery(next) <= now {
            self.pending.pop_front()
        } else {
            None
        }
    }

    fn delivery(&self, frame: &ExternalPosition) -> Nanos {
        Nanos(frame.stamp_ns) + Nanos::from_millis(self.config.latency_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(until_ms: u64) -> Vec<(Nanos, ExternalPosition)> {
        let mut camera = Camera::new(&CameraConfig::default(), 1, Nanos::ZERO);
        let mut delivered = Vec::new();
        loop {
            let now = camera.next_due();
            if now > Nanos::from_millis(until_ms) {
                return delivered;
            }
            if camera.is_exposure_due(now) {
                camera.capture(now, [10.0, -20.0]);
            }
            delivered.extend(camera.deliver(now).map(|frame| (now, frame)));
        }
    }

    #[test]
    fn frames_come_at_the_rate_and_after_the_latency() {
        let delivered = run(10_000);
        assert!(
            (298..=300).contains(&delivered.len()),
            "{}",
            delivered.len()
        );
        for (number, (now, frame)) in delivered.iter().enumerate() {
            assert_eq!(frame.sequence, number as u64 + 1);
            assert_eq!(now.0 - frame.stamp_ns, 40_000_000);
        }
    }

    #[test]
    fn the_noise_is_the_configured_one() {
        let delivered = run(60_000);
        let error = |frame: &ExternalPosition| frame.position[1].to_degrees() + 20.0;
        let squares: f64 = delivered
            .iter()
            .map(|(_, frame)| error(frame).powi(2))
            .sum();
        let spread = (squares / delivered.len() as f64).sqrt();
        assert!((0.045..0.055).contains(&spread), "{spread}");
    }

    #[test]
    fn a_stall_skips_frames_and_causes_no_burst() {
        let config = CameraConfig {
            rate_hz: 10.0,
            ..CameraConfig::default()
        };
        let mut camera = Camera::new(&config, 1, Nanos::ZERO);
        camera.capture(Nanos::from_millis(550), [0.0; 2]);
        assert!(!camera.is_exposure_due(Nanos::from_millis(599)));
        assert!(camera.is_exposure_due(Nanos::from_millis(600)));
    }
}
