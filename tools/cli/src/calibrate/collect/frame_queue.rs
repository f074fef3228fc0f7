//! Camera frames waiting for their place in the recording, and for the next, which shows outliers.

use std::collections::VecDeque;

use i2ris::units::{MAX_OUTPUTS, Nanos};
use i2ris::{ipc::payload::ExternalPosition, model::file::OutputUnit};

const NEIGHBOURS_NS: u64 = 300_000_000;
/// The largest possible values, in degrees and mm: recordings with larger ones are refused.
const MAX_ANGLE_DEG: f64 = 180.0;
const MAX_POSITION_MM: f64 = 1000.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFrame {
    pub stamp: Nanos,
    pub outputs: [f64; MAX_OUTPUTS],
}

pub struct FrameQueue {
    unit: OutputUnit,
    outputs: usize,
    /// Distance in one output from both neighbours that makes an outlier, in the unit.
    outlier: f64,
    queue: VecDeque<CameraFrame>,
    /// Last good frame returned by `pop`.
    before: Option<CameraFrame>,
}

impl FrameQueue {
    pub fn new(unit: OutputUnit, outputs: usize, outlier: f64) -> Self {
        Self { unit, outputs, outlier, queue: VecDeque::new(), before: None }
    }

    /// Adds a camera frame; false if its stamp is not above that of the previous frame.
    pub fn push(&mut self, seen: &ExternalPosition) -> bool {
        let stamp = Nanos(seen.stamp_ns);
        let rises = self.queue.back().is_none_or(|last| last.stamp < stamp);
        if rises {
            let mut outputs = [0.0; MAX_OUTPUTS];
            let values = outputs.iter_mut().zip(seen.position).take(self.outputs);
            values.for_each(|(output, position)| *output = position / self.unit.si());
            self.queue.push_back(CameraFrame { stamp, outputs });
        }
        rises
    }

    /// Stamp of the next frame that can be assessed: one with a successor, or any if `all`.
    pub fn next(&self, all: bool) -> Option<Nanos> {
        let ready = self.queue.len() > 1 || all;
        self.queue.front().filter(|_| ready).map(|frame| frame.stamp)
    }

    pub fn pop(&mut self) -> Option<(CameraFrame, bool)> {
        let frame = self.queue.pop_front()?;
        let is_outlier = self.impossible(&frame) || self.stands_out(&frame);
        if !is_outlier {
            self.before = Some(frame);
        }
        Some((frame, is_outlier))
    }

    fn impossible(&self, frame: &CameraFrame) -> bool {
        let is_angle = self.unit == OutputUnit::Deg;
        let most = if is_angle { MAX_ANGLE_DEG } else { MAX_POSITION_MM };
        frame.outputs.iter().any(|output| output.is_nan() || output.abs() > most)
    }

    /// Far from both neighbours, which are near each other.
    fn stands_out(&self, frame: &CameraFrame) -> bool {
        let near = |other: &&CameraFrame| other.stamp.0.abs_diff(frame.stamp.0) <= NEIGHBOURS_NS;
        let neighbours = self.before.as_ref().filter(near).zip(self.queue.front().filter(near));
        let Some((before, after)) = neighbours else { return false };
        let apart = |a: &CameraFrame, b: &CameraFrame, output: usize| {
            (a.outputs[output] - b.outputs[output]).abs()
        };
        (0..self.outputs).any(|output| {
            let far = |other| apart(frame, other, output) > self.outlier;
            far(before) && far(after) && apart(before, after, output) <= self.outlier
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(milliseconds: u64, pitch_deg: f64) -> ExternalPosition {
        let (stamp_ns, position) = (milliseconds * 1_000_000, [pitch_deg.to_radians(), 0.1, 0.0]);
        ExternalPosition { stamp_ns, position, count: 2, flags: 1, ..Default::default() }
    }

    fn judge(angles: &[(u64, f64)]) -> Vec<bool> {
        let mut frames = FrameQueue::new(OutputUnit::Deg, 2, 3.0);
        angles.iter().for_each(|(time, angle)| assert!(frames.push(&seen(*time, *angle))));
        std::iter::from_fn(|| frames.pop()).map(|(_, is_outlier)| !is_outlier).collect()
    }

    #[test]
    fn frame_far_from_both_neighbours_is_an_outlier() {
        assert_eq!(judge(&[(0, 1.0), (33, 9.0), (66, 1.4), (99, 1.6)]), [true, false, true, true]);
    }

    #[test]
    fn fast_motion_step_and_single_frame_are_not_outliers() {
        assert_eq!(judge(&[(0, 1.0), (33, 5.0), (66, 9.0)]), [true, true, true]);
        assert_eq!(judge(&[(0, 1.0), (33, 1.0), (66, 9.0), (99, 9.0)]), [true, true, true, true]);
        assert_eq!(judge(&[(0, 1.0), (1000, 9.0), (2000, 1.0)]), [true, true, true]);
    }

    #[test]
    fn impossible_angle_is_always_an_outlier() {
        assert_eq!(judge(&[(0, 200.0), (33, f64::NAN), (66, 1.0)]), [false, false, true]);
    }

    #[test]
    fn stamps_rise() {
        let mut frames = FrameQueue::new(OutputUnit::Deg, 2, 3.0);
        assert!(frames.push(&seen(100, 1.0)) && !frames.push(&seen(100, 1.0)));
        assert_eq!((frames.next(false), frames.next(true)), (None, Some(Nanos::from_millis(100))));
    }
}
