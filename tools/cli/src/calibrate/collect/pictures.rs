//! Pictures that wait for their place in the recording, and for the one after them, to be judged by
//! it. Pure.

use std::collections::VecDeque;

use i2ris::ipc::payload::ExternalPosition;
use i2ris::model::file::OutputUnit;
use i2ris::units::{MAX_OUTPUTS, Nanos};

/// Pictures further apart than this say nothing about each other, ns.
const NEIGHBOURS_NS: u64 = 300_000_000;

/// Beyond this no picture is true, in degrees and mm: recordings with such values are refused.
const MOST_DEG: f64 = 180.0;
const MOST_MM: f64 = 1000.0;

/// What a picture shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picture {
    /// When it was taken.
    pub stamp: Nanos,
    /// In the unit of the recording.
    pub outputs: [f64; MAX_OUTPUTS],
}

/// A picture and what to think of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Judged {
    Good(Picture),
    Outlier(Picture),
}

impl Judged {
    pub fn picture(&self) -> &Picture {
        match self {
            Self::Good(picture) | Self::Outlier(picture) => picture,
        }
    }
}

/// The queue.
#[derive(Debug)]
pub struct Pictures {
    unit: OutputUnit,
    outputs: usize,
    /// Distance in one output from both neighbours that makes an outlier, in the unit.
    outlier: f64,
    /// Taken off every stamp, s.
    latency_s: f64,
    queue: VecDeque<Picture>,
    /// The last good one that was handed out.
    before: Option<Picture>,
}

impl Pictures {
    /// An empty queue.
    pub fn new(unit: OutputUnit, outputs: usize, outlier: f64, latency_s: f64) -> Self {
        Self {
            unit,
            outputs,
            outlier,
            latency_s,
            queue: VecDeque::new(),
            before: None,
        }
    }

    /// Takes in what the camera sent; false if its stamp is not above that of the one before.
    pub fn push(&mut self, seen: &ExternalPosition) -> bool {
        let stamp = Nanos((seen.stamp_ns as f64 - self.latency_s * 1e9).max(0.0) as u64);
        let rises = self.queue.back().is_none_or(|last| last.stamp < stamp);
        if rises {
            let mut outputs = [0.0; MAX_OUTPUTS];
            let values = outputs.iter_mut().zip(seen.position).take(self.outputs);
            values.for_each(|(output, position)| *output = position / self.unit.si());
            self.queue.push_back(Picture { stamp, outputs });
        }
        rises
    }

    /// The stamp of the next picture that can be judged: one that has a successor, unless all have
    /// to go.
    pub fn next(&self, all: bool) -> Option<Nanos> {
        let ready = self.queue.len() > 1 || all;
        self.queue
            .front()
            .filter(|_| ready)
            .map(|picture| picture.stamp)
    }

    /// Hands out the next picture.
    pub fn pop(&mut self) -> Option<Judged> {
        let picture = self.queue.pop_front()?;
        if self.impossible(&picture) || self.stands_out(&picture) {
            return Some(Judged::Outlier(picture));
        }
        self.before = Some(picture);
        Some(Judged::Good(picture))
    }

    fn impossible(&self, picture: &Picture) -> bool {
        let most = match self.unit {
            OutputUnit::Deg => MOST_DEG,
            OutputUnit::Mm => MOST_MM,
        };
        picture
            .outputs
            .iter()
            .any(|output| output.is_nan() || output.abs() > most)
    }

    /// Far from both neighbours, which are near each other.
    fn stands_out(&self, picture: &Picture) -> bool {
        let near = |other: &&Picture| other.stamp.0.abs_diff(picture.stamp.0) <= NEIGHBOURS_NS;
        let (Some(before), Some(after)) = (
            self.before.as_ref().filter(near),
            self.queue.front().filter(near),
        ) else {
            return false;
        };
        let apart =
            |a: &Picture, b: &Picture, output: usize| (a.outputs[output] - b.outputs[output]).abs();
        (0..self.outputs).any(|output| {
            let far = |other| apart(picture, other, output) > self.outlier;
            far(before) && far(after) && apart(before, after, output) <= self.outlier
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(milliseconds: u64, pitch_deg: f64) -> ExternalPosition {
        let position = [pitch_deg.to_radians(), 0.1, 0.0];
        ExternalPosition {
            stamp_ns: milliseconds * 1_000_000,
            position,
            count: 2,
            flags: 1,
            ..Default::default()
        }
    }

    fn judge(angles: &[(u64, f64)]) -> Vec<bool> {
        let mut pictures = Pictures::new(OutputUnit::Deg, 2, 3.0, 0.0);
        angles
            .iter()
            .for_each(|(time, angle)| assert!(pictures.push(&seen(*time, *angle))));
        std::iter::from_fn(|| pictures.pop())
            .map(|judged| matches!(judged, Judged::Good(_)))
            .collect()
    }

    #[test]
    fn a_reading_that_stands_alone_is_an_outlier() {
        assert_eq!(
            judge(&[(0, 1.0), (33, 9.0), (66, 1.4), (99, 1.6)]),
            [true, false, true, true]
        );
    }

    #[test]
    fn fast_motion_a_step_and_a_lone_picture_are_none() {
        assert_eq!(judge(&[(0, 1.0), (33, 5.0), (66, 9.0)]), [true, true, true]);
        assert_eq!(
            judge(&[(0, 1.0), (33, 1.0), (66, 9.0), (99, 9.0)]),
            [true, true, true, true]
        );
        assert_eq!(
            judge(&[(0, 1.0), (1000, 9.0), (2000, 1.0)]),
            [true, true, true]
        );
    }

    #[test]
    fn an_angle_that_no_snake_has_is_always_one() {
        assert_eq!(
            judge(&[(0, 200.0), (33, f64::NAN), (66, 1.0)]),
            [false, false, true]
        );
    }

    #[test]
    fn stamps_rise_and_lose_the_latency() {
        let mut pictures = Pictures::new(OutputUnit::Deg, 2, 3.0, 0.040);
        assert!(pictures.push(&seen(100, 1.0)) && !pictures.push(&seen(100, 1.0)));
        assert_eq!(
            (pictures.next(false), pictures.next(true)),
            (None, Some(Nanos::from_millis(60)))
        );
    }
}
