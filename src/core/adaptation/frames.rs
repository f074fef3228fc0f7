//! Frames: which of them can be used at all, and how many could not.

use serde::{Deserialize, Serialize};

use super::report::FrameCounts;
use crate::core::drift::Pair;
use crate::core::drift::geometry::pair;
use crate::core::inputs::ExternalPose;
use crate::core::vector;
use crate::units::Nanos;

/// Frames closer together add nothing: the error of the model is the same in all of them.
const LEAST_INTERVAL: Nanos = Nanos::from_millis(10);

/// Frames older than this are not used, whatever the ring holds.
const OLDEST: Nanos = Nanos::from_millis(350);

/// A frame in order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub stamp: Nanos,
    pub pose: Pair,
    /// Since the last frame in order, s.
    pub interval_s: f64,
    /// When it arrived, after its stamp, s.
    pub age_s: f64,
}

/// Drops frames out of order, and counts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct FrameFilter {
    newest: Nanos,
    pub counts: FrameCounts,
}

impl FrameFilter {
    /// A frame that can be compared with the model.
    pub fn take(
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
        } else if frame.stamp.duration_since(self.newest) < LEAST_INTERVAL {
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
    pub fn silence(&self, now: Nanos) -> Nanos {
        now.duration_since(self.newest)
    }
}
