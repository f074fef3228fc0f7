//! Conditions that pause learning.

use serde::{Deserialize, Serialize};

use super::excitation::forget;
use super::report::{Pause, Pauses};
use crate::units::Nanos;

/// Nothing is learned for this long after a fault, a swap, a conditioning cycle, or the start.
const SETTLING: Nanos = Nanos::from_millis(2000);

/// Silence after which the camera counts as absent.
const SILENCE: Nanos = Nanos::from_millis(2500);

/// Shares of refused frames at which the camera is rejected and accepted again, and the averaging
/// time, s.
const REJECT_SHARE: f64 = 0.5;
const ACCEPT_SHARE: f64 = 0.3;
const REFUSED_S: f64 = 3.0;

/// State of the cycle in this tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::core) struct Surroundings {
    pub now: Nanos,
    /// ENABLED, and a goal is followed with the clutch closed.
    pub is_following: bool,
    /// A fault, a conditioning cycle, a change of state.
    pub is_unsettled: bool,
    /// The robot is DISABLED: a reverted correction may be tried once more.
    pub is_disabled: bool,
}

/// State of the conditions.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Conditions {
    settled_at: Nanos,
    refused_share: f64,
    is_rejected: bool,
}

impl Conditions {
    /// Pauses learning for the settling time.
    pub(crate) fn unsettle(&mut self, now: Nanos) {
        self.settled_at = now + SETTLING;
    }

    /// Accepts the camera: its frames agree again for a known reason.
    pub(crate) fn accept_camera(&mut self) {
        (self.refused_share, self.is_rejected) = (0.0, false);
    }

    /// Counts an accepted or refused frame. Returns whether the camera is accepted, if that has
    /// changed.
    pub(super) fn add_frame(&mut self, is_accepted: bool, seconds: f64) -> Option<bool> {
        let refused = if is_accepted { 0.0 } else { 1.0 };
        self.refused_share = forget(self.refused_share, refused, REFUSED_S, seconds);
        let limit = if self.is_rejected { ACCEPT_SHARE } else { REJECT_SHARE };
        let is_rejected = self.refused_share > limit;
        let has_changed = is_rejected != self.is_rejected;
        self.is_rejected = is_rejected;
        has_changed.then_some(!is_rejected)
    }

    pub(crate) fn is_settled(&self, now: Nanos) -> bool {
        now >= self.settled_at
    }

    /// Present reasons not to learn.
    pub(super) fn pauses(&self, surroundings: &Surroundings, silence: Nanos) -> Pauses {
        Pauses::NONE
            .with(Pause::NotFollowing, !surroundings.is_following)
            .with(Pause::Settling, !self.is_settled(surroundings.now))
            .with(Pause::NoCamera, silence > SILENCE)
            .with(Pause::CameraRejected, self.is_rejected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn camera_with_mostly_refused_frames_is_rejected() {
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
