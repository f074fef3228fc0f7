//! Other cameras: told when one comes, and then every ten seconds as long as it publishes.

use serde::{Deserialize, Serialize};

use crate::units::Nanos;

/// Shortest time between two events.
const PERIOD: Nanos = Nanos::from_millis(10_000);

/// What was told.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct OtherCameras {
    frames: u64,
    told: Nanos,
}

impl OtherCameras {
    /// Takes the number of their frames since the start. Returns it if it is an event now.
    pub fn update(&mut self, frames: u64, now: Nanos) -> Option<u64> {
        let is_due = self.frames == 0 || now.since(self.told) >= PERIOD;
        let is_news = frames > self.frames && is_due;
        if is_news {
            (self.frames, self.told) = (frames, now);
        }
        is_news.then_some(frames)
    }
}
