//! The camera: angles of the snake at a fixed rate, with noise, latency and faults.

mod fault;

use std::collections::VecDeque;

use i2ris::ipc::payload::ExternalPosition;
use i2ris::units::Nanos;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use fault::CameraFaults;
pub use fault::{CameraFault, TimedCameraFault};

#[derive(Debug, Clone, PartialEq)]
pub struct CameraConfig {
    /// Frames per second.
    pub rate_hz: f64,
    /// Standard deviation of a measured angle, degrees.
    pub noise_deg: f64,
    /// Delay from exposure to delivery, milliseconds.
    pub latency_ms: u64,
    pub faults: Vec<TimedCameraFault>,
}

impl Default for CameraConfig {
    fn default() -> Self {
        Self { rate_hz: 30.0, noise_deg: 0.05, latency_ms: 40, faults: Vec::new() }
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
    faults: CameraFaults,
    /// Captured, but not delivered yet, with the instants of delivery.
    pending: VecDeque<(Nanos, ExternalPosition)>,
}

impl Camera {
    /// A camera whose first exposure is at `now`. `seed` determines noise and outliers.
    pub fn new(config: &CameraConfig, seed: u64, now: Nanos) -> Self {
        let mut faults = CameraFaults::new(seed ^ 0xCA3E_7A00);
        for fault in &config.faults {
            faults.begin(fault, now);
        }
        let is_valid = config.rate_hz > 0.0;
        let rate_hz = if is_valid { config.rate_hz.min(1000.0) } else { 1.0 };
        Self {
            config: config.clone(),
            random: Pcg64Mcg::seed_from_u64(seed),
            period: Nanos((1e9 / rate_hz) as u64),
            next_exposure: now,
            sequence: 0,
            faults,
            pending: VecDeque::new(),
        }
    }

    /// The instant of the next exposure or delivery.
    pub fn next_due(&self) -> Nanos {
        let delivery = self.pending.front().map(|(delivery, _)| *delivery);
        self.next_exposure.min(delivery.unwrap_or(self.next_exposure))
    }

    /// Starts a fault, after its own `start_s`.
    pub fn begin_fault(&mut self, fault: &TimedCameraFault, now: Nanos) {
        self.faults.begin(fault, now);
    }

    pub fn clear_faults(&mut self) {
        self.faults.clear();
    }

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
        let frame = self.faults.apply(ExternalPosition {
            sequence: self.sequence,
            stamp_ns: stamp.0,
            position,
            deviation: [deviation, deviation, 0.0],
            quality: 1.0,
            count: 2,
            flags: ExternalPosition::VALID,
        });
        let delivery = stamp + Nanos::from_millis(self.config.latency_ms);
        self.pending.extend(frame.map(|frame| (delivery, frame)));
        let missed = (stamp - self.next_exposure).0 / self.period.0;
        self.next_exposure = self.next_exposure + Nanos(self.period.0 * (missed + 1));
    }

    /// The next frame whose delivery is due.
    pub fn deliver(&mut self, now: Nanos) -> Option<ExternalPosition> {
        let (delivery, _) = self.pending.front()?;
        if *delivery > now {
            return None;
        }
        self.pending.pop_front().map(|(_, frame)| frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(until_ms: u64) -> Vec<(Nanos, ExternalPosition)> {
        run_with(&[], until_ms)
    }

    /// The angles are 10 and -20 deg.
    fn run_with(faults: &[TimedCameraFault], until_ms: u64) -> Vec<(Nanos, ExternalPosition)> {
        let config = CameraConfig { faults: faults.to_vec(), ..CameraConfig::default() };
        let mut camera = Camera::new(&config, 1, Nanos::ZERO);
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
        assert!((298..=300).contains(&delivered.len()), "{}", delivered.len());
        for (number, (now, frame)) in delivered.iter().enumerate() {
            assert_eq!(frame.sequence, number as u64 + 1);
            assert_eq!(now.0 - frame.stamp_ns, 40_000_000);
        }
    }

    #[test]
    fn the_noise_is_the_configured_one() {
        let delivered = run(60_000);
        let error = |frame: &ExternalPosition| frame.position[1].to_degrees() + 20.0;
        let squares: f64 = delivered.iter().map(|(_, frame)| error(frame).powi(2)).sum();
        let spread = (squares / delivered.len() as f64).sqrt();
        assert!((0.045..0.055).contains(&spread), "{spread}");
    }

    /// Frames after a fault that starts at 2 s.
    fn with(fault: CameraFault) -> Vec<(Nanos, ExternalPosition)> {
        let timed = TimedCameraFault { start_s: 2.0, for_s: Some(10.0), fault };
        assert_eq!(timed.check(), Ok(()));
        let frames = run_with(&[timed], 14_000);
        let good = run(14_000);
        // Frames before and after are correct.
        let outside = |(now, _): &&(Nanos, ExternalPosition)| {
            let ms = now.0 / 1_000_000;
            !(2000..12_100).contains(&ms)
        };
        assert!(frames.iter().filter(outside).eq(good.iter().filter(outside)));
        let inside =
            |(now, _): &(Nanos, ExternalPosition)| (2100..12_000).contains(&(now.0 / 1_000_000));
        frames.into_iter().filter(inside).collect()
    }

    fn mean(frames: &[(Nanos, ExternalPosition)]) -> [f64; 2] {
        [0, 1].map(|axis: usize| {
            let sum: f64 = frames.iter().map(|(_, frame)| frame.position[axis]).sum();
            (sum / frames.len() as f64).to_degrees()
        })
    }

    #[test]
    fn faults_act_only_within_their_time() {
        for (fault, expected) in [
            (CameraFault::Bias { deg: [1.0, 2.0] }, [11.0, -18.0]),
            (CameraFault::Swapped {}, [-20.0, 10.0]),
            (CameraFault::Mirrored { axes: [false, true] }, [10.0, 20.0]),
        ] {
            let found = mean(&with(fault));
            let off = (found[0] - expected[0]).hypot(found[1] - expected[1]);
            assert!(off < 0.03, "{fault:?}: {found:?}");
        }
        let frozen = with(CameraFault::Frozen {});
        assert!(frozen.windows(2).all(|pair| pair[0].1.position == pair[1].1.position));
        assert!(frozen.windows(2).all(|pair| pair[0].1.stamp_ns < pair[1].1.stamp_ns));
        assert!(with(CameraFault::Silent {}).is_empty());
        for (now, frame) in with(CameraFault::LateStamps { ms: -25.0 }) {
            assert_eq!(now.0 - frame.stamp_ns, 65_000_000);
        }
        let (share, size_deg) = (0.2, 5.0);
        let frames = with(CameraFault::Outliers { share, size_deg });
        let is_off = |(_, frame): &&(Nanos, ExternalPosition)| {
            (frame.position[0].to_degrees() - 10.0).abs() > 0.5
        };
        let part = frames.iter().filter(is_off).count() as f64 / frames.len() as f64;
        assert!((0.1..0.28).contains(&part), "{part}");
    }

    #[test]
    fn a_stall_skips_frames_and_causes_no_burst() {
        let config = CameraConfig { rate_hz: 10.0, ..CameraConfig::default() };
        let mut camera = Camera::new(&config, 1, Nanos::ZERO);
        camera.capture(Nanos::from_millis(550), [0.0; 2]);
        assert!(!camera.is_exposure_due(Nanos::from_millis(599)));
        assert!(camera.is_exposure_due(Nanos::from_millis(600)));
    }
}
