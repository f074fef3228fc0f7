//! Frames: selects the usable ones and counts the others.

use serde::{Deserialize, Serialize};

use super::report::FrameCounts;
use crate::core::drift::Pair;
use crate::core::drift::geometry::pair;
use crate::core::inputs::ExternalPose;
use crate::core::vector;
use crate::units::Nanos;

/// Frames closer together add nothing: the error of the model is the same in all of them.
const MIN_INTERVAL: Nanos = Nanos::from_millis(10);

/// Frames older than this are not used, whatever the ring holds.
const OLDEST: Nanos = Nanos::from_millis(350);

/// A usable frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub stamp: Nanos,
    pub pose: Pair,
    /// Time since the last usable frame, s.
    pub interval_s: f64,
    /// Age at arrival, s.
    pub age_s: f64,
}

/// How a frame was used.
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
}
