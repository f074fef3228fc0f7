//! Detects camera faults: changed size, frozen image, stamps that decrease, the wrong camera.

use std::collections::VecDeque;

use i2ris::units::Nanos;

use super::frame::{Frame, FrameFault, ImageSize, Picture};
use crate::image::GreyImage;

/// Checks the frames of one view one after the other and turns invalid ones into gaps.
#[derive(Debug, Default)]
pub struct StreamCheck {
    size: Option<ImageSize>,
    last_stamp: Option<Nanos>,
    last_digest: Option<u64>,
}

impl StreamCheck {
    /// Digest of the newest frame of the right size; `None` before the first.
    pub fn digest(&self) -> Option<u64> {
        self.last_digest
    }

    /// Turns a frame into a gap if its size differs from the first one's, or if it is not newer
    /// than the previous one, or identical to it. A sensor has noise: two identical frames are one
    /// frame twice.
    pub fn check(&mut self, frame: Frame) -> Frame {
        let checked = |picture: Picture| {
            let fault = self.fault(frame.stamp, &picture.image);
            fault.map_or(Ok(picture), Err)
        };
        Frame { picture: frame.picture.and_then(checked), ..frame }
    }

    fn fault(&mut self, stamp: Nanos, image: &GreyImage) -> Option<FrameFault> {
        let size = ImageSize { width: image.width(), height: image.height() };
        if *self.size.get_or_insert(size) != size {
            return Some(FrameFault::WrongSize);
        }
        let digest = image.digest();
        let is_frozen = self.last_digest.replace(digest) == Some(digest);
        if self.last_stamp.is_some_and(|last| stamp <= last) {
            return Some(FrameFault::OutOfOrder);
        }
        self.last_stamp = Some(stamp);
        is_frozen.then_some(FrameFault::Frozen)
    }
}

/// Detects that both views show the same camera.
///
/// Two programs that read one camera may get different frames from it, so one identical frame makes
/// all suspect for a while.
#[derive(Debug, Default)]
pub struct DuplicateCameraMonitor {
    recent: [VecDeque<u64>; 2],
    suspicion: u32,
}

/// Frames of each view that are remembered.
const REMEMBERED: usize = 16;
/// Frames without another match until the suspicion ends.
const SUSPICION: u32 = 128;

impl DuplicateCameraMonitor {
    /// Records a frame of `view` (0 or 1) and returns whether both views are suspect.
    pub fn is_same_camera(&mut self, view: usize, digest: u64) -> bool {
        let [first, second] = &mut self.recent;
        let (own, other) = if view == 0 { (first, second) } else { (second, first) };
        self.suspicion =
            if other.contains(&digest) { SUSPICION } else { self.suspicion.saturating_sub(1) };
        own.push_back(digest);
        if own.len() > REMEMBERED {
            own.pop_front();
        }
        self.suspicion > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_camera_in_both_views_is_detected_despite_missing_frames() {
        let mut duplicates = DuplicateCameraMonitor::default();
        let mut suspected = 0;
        for image in 0..200_u64 {
            // Each view gets two of three frames.
            for view in 0..2 {
                suspected += usize::from(
                    (image + view) % 3 != 0 && duplicates.is_same_camera(view as usize, image),
                );
            }
        }
        assert!(suspected > 250, "{suspected}");
    }

    #[test]
    fn two_cameras_are_two_and_a_single_match_is_forgotten() {
        let mut duplicates = DuplicateCameraMonitor::default();
        assert!((0..100).all(|i| !duplicates.is_same_camera((i % 2) as usize, i)));
        assert!(duplicates.is_same_camera(1, 98) && duplicates.is_same_camera(0, 1000));
        assert!(
            (0..200).map(|i| duplicates.is_same_camera((i % 2) as usize, 2000 + i)).any(|one| !one)
        );
    }
}
