//! Folding of events that a client, another camera, a clipped goal or a bad line could repeat in
//! every tick.

use serde::{Deserialize, Serialize};

use crate::robot::{Clip, Quantity};
use crate::units::Nanos;

/// Shortest time between two events of one kind, or of a clip.
const FOLD_TIME: Nanos = Nanos::from_millis(1000);

/// Reports the beginning of a condition as an event, at most once per second.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct EventFold {
    is_present: bool,
    last: Option<Nanos>,
}

impl EventFold {
    /// Updates the condition. Returns whether its beginning is an event now.
    pub(crate) fn update(&mut self, is_present: bool, now: Nanos) -> bool {
        let is_new = is_present && !self.is_present;
        self.is_present = is_present;
        let is_due = self.last.is_none_or(|last| now.duration_since(last) >= FOLD_TIME);
        if is_new && is_due {
            self.last = Some(now);
        }
        is_new && is_due
    }
}

/// Shortest time between two events of other cameras.
const PERIOD: Nanos = Nanos::from_millis(10_000);

/// Number of ignored camera frames, as last reported.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct OtherCameras {
    frames: u64,
    reported: Nanos,
}

impl OtherCameras {
    /// Updates the number of ignored frames since the start. Returns it if it is an event now.
    pub(crate) fn update(&mut self, frames: u64, now: Nanos) -> Option<u64> {
        let is_due = self.frames == 0 || now.duration_since(self.reported) >= PERIOD;
        let is_news = frames > self.frames && is_due;
        if is_news {
            (self.frames, self.reported) = (frames, now);
        }
        is_news.then_some(frames)
    }
}

/// Smaller growth is not reported: it is below the last digit of the log.
const GROWTH: f64 = 0.01;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct ClippedGoal {
    /// Client whose command is followed; 0: that of a `move_jp`.
    pub client_id: u64,
    pub clip: Clip,
    /// Distance from the request, and its unit: degrees or mm.
    pub distance: Option<(f64, Quantity)>,
}

impl ClippedGoal {
    /// More is cut off than in the other, as far as both are known.
    fn is_farther(&self, other: &Option<Self>, by: f64) -> bool {
        let Some(other) = other else { return true };
        let same = other.distance.filter(|(_, unit)| self.distance.is_some_and(|it| it.1 == *unit));
        let least = same.map_or(f64::NEG_INFINITY, |(distance, _)| distance + by);
        self.distance.is_some_and(|(distance, _)| distance > least)
    }
}

/// Reports clips, at most one event per second. The last event of a clip has its largest distance,
/// at most a second after it was reached.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct ClipEvents {
    is_present: bool,
    last: Option<Nanos>,
    /// The farthest of this clip that was reported.
    reported: Option<ClippedGoal>,
    /// The farthest that waits for its event.
    pending: Option<ClippedGoal>,
}

impl ClipEvents {
    /// Takes the clip of this tick. Returns one that is an event now. Call it once per tick.
    pub(crate) fn update(&mut self, clip: Option<ClippedGoal>, now: Nanos) -> Option<ClippedGoal> {
        if let Some(clip) = clip {
            if !self.is_present {
                self.reported = None;
            }
            let is_news = clip.is_farther(&self.reported, GROWTH);
            if is_news && clip.is_farther(&self.pending, 0.0) {
                self.pending = Some(clip);
            }
        }
        self.is_present = clip.is_some();
        let is_due = self.last.is_none_or(|last| now.duration_since(last) >= FOLD_TIME);
        let event = if is_due { self.pending.take() } else { None };
        if event.is_some() {
            (self.last, self.reported) = (Some(now), event);
        }
        event
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_beginnings_are_events_and_flapping_is_folded() {
        let mut fold = EventFold::default();
        for (ms, is_present, is_event) in [
            (0, true, true),
            (1, true, false),
            (2, false, false),
            (3, true, false),
            (4, false, false),
            (1000, true, true),
            (5000, true, false),
        ] {
            let now = Nanos::from_millis(10_000 + ms);
            assert_eq!(fold.update(is_present, now), is_event, "{ms} ms");
        }
    }

    /// The events of a clip with these distances, one every 100 ms; NaN: no clip.
    fn events(distances_deg: &[f64]) -> Vec<(usize, f64)> {
        let mut clips = ClipEvents::default();
        let update = |(index, distance): (usize, &f64)| {
            let now = Nanos::from_millis(10_000 + 100 * index as u64);
            let clip = (!distance.is_nan()).then_some(ClippedGoal {
                client_id: 7,
                clip: Clip::Reach,
                distance: Some((*distance, Quantity::Degrees)),
            });
            let event = clips.update(clip, now)?;
            Some((index, event.distance?.0))
        };
        distances_deg.iter().enumerate().filter_map(update).collect()
    }

    #[test]
    fn the_largest_distance_follows_the_beginning() {
        let growing: Vec<f64> = (0..25).map(|tick| f64::from(tick).min(17.0)).collect();
        assert_eq!(events(&growing), [(0, 0.0), (10, 10.0), (20, 17.0)]);
    }

    #[test]
    fn the_largest_distance_is_reported_after_the_end() {
        let mut short = [f64::NAN; 30];
        short[3..6].copy_from_slice(&[1.0, 4.0, 2.0]);
        assert_eq!(events(&short), [(3, 1.0), (13, 4.0)]);
    }

    #[test]
    fn constant_clip_is_one_event() {
        assert_eq!(events(&[5.0; 40]), [(0, 5.0)]);
        assert_eq!(events(&[5.0, 5.005].repeat(20)), [(0, 5.0)]);
    }

    #[test]
    fn flapping_clip_reports_largest_distance_once_per_second() {
        let mut flapping = [1.0, f64::NAN].repeat(20);
        (flapping[6], flapping[14]) = (3.0, 2.0);
        assert_eq!(events(&flapping), [(0, 1.0), (10, 3.0), (20, 2.0), (30, 1.0)]);
    }

    #[test]
    fn clip_of_unknown_distance_is_reported_once() {
        let mut clips = ClipEvents::default();
        let clip = ClippedGoal { client_id: 0, clip: Clip::Reach, distance: None };
        let found = (0..5000).filter(|ms| {
            let now = Nanos::from_millis(10_000 + ms);
            clips.update((*ms < 4000).then_some(clip), now).is_some()
        });
        assert_eq!(found.collect::<Vec<_>>(), [0]);
    }
}
