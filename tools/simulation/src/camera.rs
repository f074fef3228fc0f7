//! The camera: angles of the snake at a fixed rate, with noise, latency and faults.

use std::collections::VecDeque;

use i2ris::ipc::payload::ExternalPosition;
use i2ris::units::Nanos;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

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
    faults: Vec<RunningFault>,
    /// For the errors of outliers.
    outliers: Pcg64Mcg,
    /// Captured, but not delivered yet, with the instants of delivery.
    pending: VecDeque<(Nanos, ExternalPosition)>,
}

impl Camera {
    /// A camera whose first exposure is at `now`. `seed` determines noise and outliers.
    pub fn new(config: &CameraConfig, seed: u64, now: Nanos) -> Self {
        let rate_hz = if config.rate_hz > 0.0 { config.rate_hz.min(1000.0) } else { 1.0 };
        let mut camera = Self {
            config: config.clone(),
            random: Pcg64Mcg::seed_from_u64(seed),
            period: Nanos((1e9 / rate_hz) as u64),
            next_exposure: now,
            sequence: 0,
            faults: Vec::new(),
            outliers: Pcg64Mcg::seed_from_u64(seed ^ 0xCA3E_7A00),
            pending: VecDeque::new(),
        };
        for fault in &config.faults {
            camera.begin_fault(fault, now);
        }
        camera
    }

    /// The instant of the next exposure or delivery.
    pub fn next_due(&self) -> Nanos {
        let delivery = self.pending.front().map(|(delivery, _)| *delivery);
        self.next_exposure.min(delivery.unwrap_or(self.next_exposure))
    }

    /// Starts a fault, after its own `start_s`.
    pub fn begin_fault(&mut self, fault: &TimedCameraFault, now: Nanos) {
        let span = |seconds: f64| Nanos((seconds * 1e9) as u64);
        let from = now + span(fault.start_s);
        self.faults.push(RunningFault {
            from,
            until: fault.for_s.map(|seconds| from + span(seconds)),
            fault: fault.fault,
            first: None,
        });
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
        let frame = self.faulty(ExternalPosition {
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
        self.pending.front().filter(|(delivery, _)| *delivery <= now)?;
        self.pending.pop_front().map(|(_, frame)| frame)
    }

    /// The frame delivered instead of a good one, if any.
    fn faulty(&mut self, mut frame: ExternalPosition) -> Option<ExternalPosition> {
        let exposed = Nanos(frame.stamp_ns);
        let random = &mut self.outliers;
        let is_on = |it: &&mut RunningFault| {
            it.from <= exposed && it.until.is_none_or(|until| exposed < until)
        };
        for running in self.faults.iter_mut().filter(is_on) {
            let [pitch, yaw, _] = &mut frame.position;
            match running.fault {
                CameraFault::Outliers { share, size_deg } => {
                    if random.random::<f64>() < share {
                        let size = size_deg.to_radians();
                        *pitch += size * (2.0 * random.random::<f64>() - 1.0);
                        *yaw += size * (2.0 * random.random::<f64>() - 1.0);
                    }
                }
                CameraFault::Bias { deg } => {
                    *pitch += deg[0].to_radians();
                    *yaw += deg[1].to_radians();
                }
                CameraFault::Frozen {} => {
                    frame.position = *running.first.get_or_insert(frame.position);
                }
                CameraFault::Swapped {} => std::mem::swap(pitch, yaw),
                CameraFault::Mirrored { axes } => {
                    let sign = axes.map(|mirrored| if mirrored { -1.0 } else { 1.0 });
                    *pitch *= sign[0];
                    *yaw *= sign[1];
                }
                CameraFault::LateStamps { ms } => {
                    let stamp = frame.stamp_ns.saturating_add_signed((ms * 1e6) as i64);
                    frame.stamp_ns = stamp;
                }
                CameraFault::Silent {} => return None,
            }
        }
        Some(frame)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "fault", rename_all = "kebab-case", deny_unknown_fields)]
pub enum CameraFault {
    /// A share of the frames has errors, evenly distributed up to a size in pitch and in yaw.
    Outliers {
        /// 0 to 1.
        share: f64,
        /// Degrees.
        size_deg: f64,
    },
    Bias {
        /// Degrees.
        deg: [f64; 2],
    },
    /// The angles of the first frame are repeated, with new stamps.
    Frozen {},
    Swapped {},
    /// Pitch, yaw or both have the wrong sign.
    Mirrored {
        /// Pitch and yaw.
        axes: [bool; 2],
    },
    /// The stamps are later than the exposures by this time; earlier if negative.
    LateStamps {
        /// Milliseconds.
        ms: f64,
    },
    Silent {},
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimedCameraFault {
    /// When it begins, seconds after the start, or after the command.
    #[serde(default)]
    pub start_s: f64,
    /// How long it lasts, seconds. Absent: to the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub for_s: Option<f64>,
    #[serde(flatten)]
    pub fault: CameraFault,
}

impl TimedCameraFault {
    /// Checks all values; the error is a sentence.
    pub fn check(&self) -> Result<(), String> {
        let within = |key: &str, value: f64, low: f64, high: f64| {
            let wrong = || format!("camera.{key} = {value}: must be {low} to {high}");
            (low..=high).contains(&value).then_some(()).ok_or_else(wrong)
        };
        within("start_s", self.start_s, 0.0, 1e9)?;
        within("for_s", self.for_s.unwrap_or(0.0), 0.0, 1e9)?;
        match self.fault {
            CameraFault::Outliers { share, size_deg } => {
                within("share", share, 0.0, 1.0)?;
                within("size_deg", size_deg, 0.0, 180.0)
            }
            CameraFault::Bias { deg: [pitch, yaw] } => {
                within("deg", pitch, -180.0, 180.0)?;
                within("deg", yaw, -180.0, 180.0)
            }
            CameraFault::LateStamps { ms } => within("ms", ms, -10_000.0, 10_000.0),
            CameraFault::Frozen {}
            | CameraFault::Swapped {}
            | CameraFault::Mirrored { .. }
            | CameraFault::Silent {} => Ok(()),
        }
    }
}

#[derive(Debug)]
struct RunningFault {
    from: Nanos,
    until: Option<Nanos>,
    fault: CameraFault,
    /// The angles of its first frame, rad.
    first: Option<[f64; 3]>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The angles are 10 and -20 deg.
    fn run(faults: &[TimedCameraFault], until_ms: u64) -> Vec<(Nanos, ExternalPosition)> {
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
        let delivered = run(&[], 10_000);
        assert!((298..=300).contains(&delivered.len()), "{}", delivered.len());
        for (number, (now, frame)) in delivered.iter().enumerate() {
            assert_eq!(frame.sequence, number as u64 + 1);
            assert_eq!(now.0 - frame.stamp_ns, 40_000_000);
        }
    }

    #[test]
    fn the_noise_is_the_configured_one() {
        let delivered = run(&[], 60_000);
        let error = |frame: &ExternalPosition| frame.position[1].to_degrees() + 20.0;
        let squares: f64 = delivered.iter().map(|(_, frame)| error(frame).powi(2)).sum();
        let spread = (squares / delivered.len() as f64).sqrt();
        assert!((0.045..0.055).contains(&spread), "{spread}");
    }

    /// Frames after a fault that starts at 2 s.
    fn with(fault: CameraFault) -> Vec<(Nanos, ExternalPosition)> {
        let timed = TimedCameraFault { start_s: 2.0, for_s: Some(10.0), fault };
        assert_eq!(timed.check(), Ok(()));
        let frames = run(&[timed], 14_000);
        let good = run(&[], 14_000);
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
