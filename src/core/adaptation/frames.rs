//! Frames of the camera: the usable ones, their noise, and the poses of their time.

use serde::{Deserialize, Serialize};

use super::{DEG, FrameCounts};
use crate::core::drift::geometry::{add, pair, subtract};
use crate::core::drift::{Pair, WORN};
use crate::core::inputs::ExternalPose;
use crate::core::vector;
use crate::units::Nanos;

/// Frames closer together add nothing: the error of the model is the same in all of them.
const MIN_INTERVAL: Nanos = Nanos::from_millis(10);

/// Frames older than this are not used, whatever the ring holds.
const OLDEST: Nanos = Nanos::from_millis(350);

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub stamp: Nanos,
    pub pose: Pair,
    /// Time since the last usable frame, s.
    pub interval_s: f64,
    /// Age at arrival, s.
    pub age_s: f64,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct FrameUse {
    pub is_accepted: bool,
    /// The adaptation learns from accepted frames.
    pub is_learning: bool,
}

/// Drops and counts unusable frames.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct FrameFilter {
    newest: Nanos,
    pub counts: FrameCounts,
}

impl FrameFilter {
    /// A frame that can be compared with the model.
    pub(super) fn take(
        &mut self,
        frame: &ExternalPose,
        outputs: usize,
        least_quality: f64,
        now: Nanos,
    ) -> Option<Frame> {
        let counts = &mut self.counts;
        let is_poor = frame.quality > 0.0 && frame.quality < least_quality;
        let is_bad = frame.outputs as usize != outputs || !vector::is_finite(&frame.position);
        let dropped = if is_bad || is_poor || frame.quality.is_nan() {
            &mut counts.bad
        } else if frame.stamp > now {
            &mut counts.future
        } else if frame.stamp == self.newest {
            &mut counts.duplicate
        } else if frame.stamp < self.newest {
            &mut counts.out_of_order
        } else if now.duration_since(frame.stamp) > OLDEST {
            &mut counts.too_old
        } else if frame.stamp.duration_since(self.newest) < MIN_INTERVAL {
            &mut counts.too_frequent
        } else {
            let interval = frame.stamp.duration_since(self.newest);
            self.newest = frame.stamp;
            return Some(Frame {
                stamp: frame.stamp,
                pose: pair(&frame.position),
                interval_s: interval.as_seconds(),
                age_s: now.duration_since(frame.stamp).as_seconds(),
            });
        };
        *dropped += 1;
        None
    }

    /// Time since the newest frame.
    pub(super) fn silence(&self, now: Nanos) -> Nanos {
        now.duration_since(self.newest)
    }
}

/// A camera is not taken to be worse than this, rad: the gate stays a gate.
const LARGEST_NOISE: f64 = 0.4 * DEG;

/// Step of the median, as a share: it follows within some seconds.
const MEDIAN_STEP: f64 = 0.02;

/// Ratio of the median squared difference of two frames to the variance of one value: twice the
/// chi-square median for one or two degrees of freedom.
const MEDIAN: [f64; 2] = [2.0 * 0.455, 2.0 * 1.386];

/// Scatter: how noisy the frames are, from frame to frame.
///
/// A camera that is noisier than configured would make the filter too sure of itself, and the gate
/// would refuse what is only noise. The difference of two consecutive frames, apart from the model,
/// is the noise of both; outliers, pushes and drift do not show in the median of its square.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Scatter {
    last: Option<Pair>,
    /// rad squared.
    variance: f64,
}

impl Scatter {
    /// Takes an innovation, and returns the variance of the noise: at least that of the
    /// configuration. `camera`: its deviation, rad.
    pub(super) fn add(&mut self, innovation: Pair, outputs: usize, camera: f64) -> f64 {
        let least = camera * camera;
        if let Some(last) = self.last {
            let [x, y] = subtract(innovation, last);
            let median = if outputs < 2 { MEDIAN[0] } else { MEDIAN[1] };
            let is_above = x * x + y * y > median * self.variance;
            self.variance *= if is_above { 1.0 + MEDIAN_STEP } else { 1.0 - MEDIAN_STEP };
        }
        self.last = Some(innovation);
        self.variance = self.variance.max(least).min((LARGEST_NOISE * LARGEST_NOISE).max(least));
        self.variance
    }
}

/// The entries are stored in rows of 32: serde has no longer arrays.
const ROWS: usize = 3;
const COLUMNS: usize = 32;
const CAPACITY: u64 = (ROWS * COLUMNS) as u64;

/// Least interval between two entries. All of them cover at least 384 ms.
pub(super) const SPACING: Nanos = Nanos::from_millis(4);

/// A frame this much newer than the newest entry is taken to be of its time: positions come every
/// few milliseconds.
const NEWER: Nanos = Nanos::from_millis(10);

/// Half of the span over which a rate is computed: one count within one interval does not define a
/// rate.
const RATE_SPAN: Nanos = Nanos::from_millis(20);

/// The poses of one moment, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Moment {
    pub stamp: Nanos,
    pub calibrated: Pair,
    /// With the gap scale in use.
    pub gapped: Pair,
    /// With all of the correction in use.
    pub adapted: Pair,
    /// Change of `gapped` per growth of wear, and the wear in use.
    pub slopes: [Pair; WORN],
    pub wear: [f64; WORN],
}

/// The poses at the time of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Regressors {
    pub moment: Moment,
    /// Rate of `gapped`, rad/s.
    pub rate: Pair,
    /// Latency subtracted from the stamp, s.
    pub latency_s: f64,
}

/// The poses of the last moments, for frames that arrive late; oldest overwritten first.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct RegressorRing {
    moments: [[Moment; COLUMNS]; ROWS],
    written: u64,
}

impl RegressorRing {
    pub(super) fn newest(&self) -> Option<&Moment> {
        self.moment(self.written.checked_sub(1)?)
    }

    pub(super) fn is_due(&self, stamp: Nanos) -> bool {
        self.newest().is_none_or(|newest| stamp.duration_since(newest.stamp) >= SPACING)
    }

    pub(super) fn push(&mut self, moment: Moment) {
        let index = (self.written % CAPACITY) as usize;
        if let Some(entry) = self.moments.as_flattened_mut().get_mut(index) {
            *entry = moment;
            self.written += 1;
        }
    }

    /// The poses at the stamp of a frame that is older than its stamp by a latency; `None` if that
    /// is older or newer than the ring.
    pub(super) fn at(&self, stamp: Nanos, latency_s: f64) -> Option<Regressors> {
        let shift = Nanos((1e9 * latency_s.abs()) as u64);
        let stamp = if latency_s > 0.0 { stamp - shift } else { stamp + shift };
        let moment = self.interpolate(stamp)?;
        let before = self.interpolate(stamp - RATE_SPAN).unwrap_or(moment);
        let after = self.interpolate(stamp + RATE_SPAN).unwrap_or(moment);
        let span = after.stamp.duration_since(before.stamp).as_seconds();
        let change = subtract(after.gapped, before.gapped);
        let rate = if span > 0.0 { change.map(|change| change / span) } else { Pair::default() };
        Some(Regressors { moment, rate, latency_s })
    }

    fn interpolate(&self, stamp: Nanos) -> Option<Moment> {
        let newest = self.newest()?;
        if stamp >= newest.stamp {
            return (stamp.duration_since(newest.stamp) <= NEWER).then_some(*newest);
        }
        let oldest = self.written.saturating_sub(CAPACITY);
        let mut after = newest;
        for number in (oldest..self.written.saturating_sub(1)).rev() {
            let before = self.moment(number)?;
            if before.stamp <= stamp {
                return Some(between(before, after, stamp));
            }
            after = before;
        }
        None
    }

    fn moment(&self, number: u64) -> Option<&Moment> {
        self.moments.as_flattened().get((number % CAPACITY) as usize)
    }
}

fn between(before: &Moment, after: &Moment, stamp: Nanos) -> Moment {
    let span = after.stamp.duration_since(before.stamp).as_seconds();
    let part =
        if span > 0.0 { stamp.duration_since(before.stamp).as_seconds() / span } else { 0.0 };
    let mix = |a: Pair, b: Pair| add(a, subtract(b, a).map(|change| part * change));
    Moment {
        stamp,
        calibrated: mix(before.calibrated, after.calibrated),
        gapped: mix(before.gapped, after.gapped),
        adapted: mix(before.adapted, after.adapted),
        slopes: std::array::from_fn(|index| mix(before.slopes[index], after.slopes[index])),
        wear: after.wear,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unusable_frames_are_dropped_and_counted() {
        let mut filter = FrameFilter::default();
        let ms = |t: u64| Nanos::from_millis(1000 + t);
        let frame = |t: u64| ExternalPose {
            stamp: ms(t),
            position: [0.1, 0.2, 0.0],
            outputs: 2,
            quality: 0.0,
        };
        let not_finite = ExternalPose { position: [f64::NAN; 3], ..frame(200) };
        let poor = ExternalPose { quality: 0.1, ..frame(200) };
        let other = ExternalPose { outputs: 1, ..frame(200) };
        let cases = [
            (frame(0), true),
            (frame(0), false),
            (frame(33), true),
            (frame(20), false),
            (frame(900), false),
            (frame(38), false),
            (not_finite, false),
            (poor, false),
            (other, false),
            (frame(66), true),
        ];
        for (index, (frame, is_used)) in cases.iter().enumerate() {
            let found = filter.take(frame, 2, 0.3, ms(300));
            assert_eq!(found.is_some(), *is_used, "case {index}");
        }
        assert_eq!(filter.take(&frame(100), 2, 0.3, ms(500)), None);
        let expected = FrameCounts {
            duplicate: 1,
            out_of_order: 1,
            future: 1,
            too_old: 1,
            too_frequent: 1,
            bad: 3,
            ..FrameCounts::default()
        };
        assert_eq!(filter.counts, expected);
    }

    /// Nearly normal number from twelve uniform ones; by SplitMix64 (G. L. Steele et al. 2014).
    fn normal(state: &mut u64) -> f64 {
        let mut unit = || {
            *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (*state ^ (*state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| unit() - 0.5).sum()
    }

    #[test]
    fn noise_is_found_whatever_outliers_and_pushes_there_are() {
        let mut random = 3;
        for (noise, found) in [(0.03, 0.07), (0.15, 0.15), (0.3, 0.3), (20.0, 0.4)] {
            let mut scatter = Scatter::default();
            let mut sum = 0.0;
            for frame in 0..4000 {
                let mut seen = [0.0, 1.0].map(|at| at + noise * normal(&mut random));
                if frame % 30 == 0 {
                    seen[0] += 5.0;
                }
                let push = if frame % 1000 > 500 { 2.0 } else { 0.0 };
                let seen = seen.map(|deg| (deg + push) * DEG);
                let variance = scatter.add(seen, 2, 0.07 * DEG);
                sum += if frame >= 1000 { variance } else { 0.0 };
            }
            let mean = (sum / 3000.0).sqrt() / DEG;
            assert!((mean - found).abs() < 0.12 * found, "{mean} instead of {found}");
        }
    }

    fn ms(milliseconds: u64) -> Nanos {
        Nanos::from_millis(milliseconds)
    }

    /// 500 ms at 1 rad/s.
    fn moving() -> RegressorRing {
        let mut ring = RegressorRing::default();
        for t in (1000..=1500).step_by(5) {
            assert!(ring.is_due(ms(t)));
            ring.push(Moment { stamp: ms(t), gapped: [1e-3 * t as f64, 0.0], ..Moment::default() });
            assert!(!ring.is_due(ms(t + 3)));
        }
        ring
    }

    #[test]
    fn late_frame_gets_the_pose_of_its_time() {
        let ring = moving();
        for t in [1100, 1252, 1497] {
            let found = ring.at(ms(t + 10), 0.01).unwrap();
            assert!((found.moment.gapped[0] - 1e-3 * t as f64).abs() < 1e-12);
            assert!((found.rate[0] - 1.0).abs() < 1e-9, "{t} {found:?}");
        }
    }

    #[test]
    fn ring_covers_only_its_span() {
        let ring = moving();
        assert!(ring.at(ms(1250), 0.0).is_some());
        assert_eq!(ring.at(ms(1015), 0.0), None);
        assert!(ring.at(ms(1505), 0.0).is_some());
        assert_eq!(ring.at(ms(1511), 0.0), None);
        assert_eq!(RegressorRing::default().at(ms(1), 0.0), None);
    }
}
