//! Ring of regressors: the poses of the last moments, for frames that arrive late.

use serde::{Deserialize, Serialize};

use crate::core::drift::geometry::{add, subtract};
use crate::core::drift::{Pair, WORN};
use crate::units::Nanos;

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
    /// Pose of the calibrated model.
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

/// The last moments, oldest overwritten first.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct RegressorRing {
    moments: [[Moment; COLUMNS]; ROWS],
    written: u64,
}

impl RegressorRing {
    pub(super) fn newest(&self) -> Option<&Moment> {
        self.moment(self.written.checked_sub(1)?)
    }

    /// An entry is due.
    pub(super) fn is_due(&self, stamp: Nanos) -> bool {
        self.newest().is_none_or(|newest| stamp.duration_since(newest.stamp) >= SPACING)
    }

    pub(super) fn push(&mut self, moment: Moment) {
        let index = (self.written % CAPACITY) as usize;
        let row = self.moments.get_mut(index / COLUMNS);
        if let Some(entry) = row.and_then(|row| row.get_mut(index % COLUMNS)) {
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
        let index = (number % CAPACITY) as usize;
        self.moments.get(index / COLUMNS)?.get(index % COLUMNS)
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
