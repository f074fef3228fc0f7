//! Folding of events that a client, another camera or a bad line could repeat in every tick.

use serde::{Deserialize, Serialize};

use crate::units::Nanos;

/// Shortest time between two events of one kind.
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
}
