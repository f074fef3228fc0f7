//! Conditions: when nothing is learned, and why.

use serde::{Deserialize, Serialize};

use super::excitation::forget;
use super::report::{Pause, Pauses};
use crate::units::Nanos;

/// Nothing is learned for this long after a fault, a swap, a conditioning cycle, or the start.
const SETTLING: Nanos = Nanos::from_millis(2000);

/// Without a frame for this long there is no camera.
const SILENCE: Nanos = Nanos::from_millis(2500);

/// The share of refused frames at which the camera is not believed any more, and at which it is
/// again, and the time over which it is averaged, s.
const DISBELIEF: f64 = 0.5;
const BELIEF: f64 = 0.3;
const REFUSED_S: f64 = 3.0;

/// State of the cycle in this tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::core) struct Surroundings {
    pub now: Nanos,
    /// ENABLED, and a goal is followed with the clutch closed.
    pub is_following: bool,
    /// A fault, a conditioning cycle, a change of state.
    pub is_unsettled: bool,
    /// The robot is DISABLED: a correction that was taken back may be tried once more.
    pub is_disabled: bool,
}

/// State of the conditions.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Conditions {
    settled_at: Nanos,
    refused_share: f64,
    is_disbelieved: bool,
}

impl Conditions {
    /// Something has happened after which nothing is learned for a while.
    pub fn unsettle(&mut self, now: Nanos) {
        self.settled_at = now + SETTLING;
    }

    /// The frames agree again, for a reason that is known.
    pub fn believe(&mut self) {
        (self.refused_share, self.is_disbelieved) = (0.0, false);
    }

    /// Takes a frame that was accepted or refused. Returns whether the camera is believed, if that
    /// has changed.
    pub fn add_frame(&mut self, is_accepted: bool, seconds: f64) -> Option<bool> {
        let refused = if is_accepted { 0.0 } else { 1.0 };
        self.refused_share = forget(self.refused_share, refused, REFUSED_S, seconds);
        let limit = if self.is_disbelieved { BELIEF } else { DISBELIEF };
        let is_disbelieved = self.refused_share > limit;
        let has_changed = is_disbelieved != self.is_disbelieved;
        self.is_disbelieved = is_disbelieved;
        has_changed.then_some(!is_disbelieved)
    }

    pub fn is_settled(&self, now: Nanos) -> bool {
        now >= self.settled_at
    }

    /// Why nothing is learned now.
    pub fn pauses(
        &self,
        surroundings: &Surroundings,
        memory_known: bool,
        in_hull: bool,
        silence: Nanos,
    ) -> Pauses {
        Pauses::NONE
            .with(Pause::NotFollowing, !surroundings.is_following)
            .with(Pause::Settling, !self.is_settled(surroundings.now))
            .with(Pause::MemoryUnknown, !memory_known)
            .with(Pause::OutsideHull, !in_hull)
            .with(Pause::NoCamera, silence > SILENCE)
            .with(Pause::CameraDisbelieved, self.is_disbelieved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_whose_frames_are_mostly_refused_is_not_believed() {
        let mut conditions = Conditions::default();
        let mut run = |frames: usize, is_accepted: bool| {
            (0..frames)
                .filter_map(|_| conditions.add_frame(is_accepted, 1.0 / 30.0))
                .collect::<Vec<_>>()
        };
        assert!(run(40, false).is_empty());
        assert_eq!(run(40, false), [false]);
        assert_eq!(run(200, true), [true]);
    }
}
