//! Selection of the camera to follow: one publisher of measured poses, until it has been silent for
//! a second.
//!
//! A second camera that agrees with the estimate would hide that the first does not (H12, H35).

use crate::core::ExternalPose;
use crate::units::Nanos;

/// Silence after which another publisher is followed.
const SILENCE: Nanos = Nanos::from_millis(1000);

#[derive(Debug, Default)]
pub(super) struct CameraOwner {
    /// The publisher, and the time of its last frame.
    followed: Option<(u128, Nanos)>,
    pub ignored: u64,
}

impl CameraOwner {
    /// Newest frame of the followed publisher. `frames`: valid frames, at most one per publisher.
    pub(super) fn choose(
        &mut self,
        frames: impl IntoIterator<Item = (u128, ExternalPose)>,
        now: Nanos,
    ) -> Option<ExternalPose> {
        self.followed =
            self.followed.filter(|(_, last_frame)| now.duration_since(*last_frame) < SILENCE);
        let mut chosen = None;
        for (publisher, frame) in frames {
            let (owner, last_frame) = self.followed.get_or_insert((publisher, now));
            if *owner == publisher {
                (*last_frame, chosen) = (now, Some(frame));
            } else {
                self.ignored = self.ignored.saturating_add(1);
            }
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn camera_is_followed_until_silent_for_a_second() {
        let ms = Nanos::from_millis;
        let frame = |from: u128, now: u64| {
            let position = [from as f64, 0.0, 0.0];
            (from, ExternalPose { stamp: ms(now), position, outputs: 2, quality: 0.0 })
        };
        let mut owner = CameraOwner::default();
        let mut followed = |frames: &[(u128, ExternalPose)], now| {
            owner.choose(frames.iter().copied(), ms(now)).map(|pose| pose.position[0] as u128)
        };
        assert_eq!(followed(&[], 0), None);
        assert_eq!(followed(&[frame(7, 1)], 1), Some(7));
        for now in (2..3000).step_by(33) {
            // The second one is newer, and comes first and alone.
            assert_eq!(followed(&[frame(8, now + 9), frame(7, now)], now), Some(7));
            assert_eq!(followed(&[frame(8, now + 9)], now + 1), None);
        }
        let last = 2972;
        assert_eq!(followed(&[frame(8, 3971)], last + 999), None);
        assert_eq!(followed(&[frame(8, 3972)], last + 1000), Some(8));
        assert_eq!(followed(&[frame(7, 3973), frame(8, 3973)], last + 1001), Some(8));
        assert_eq!(owner.ignored, 2 * 91 + 2);
    }
}
