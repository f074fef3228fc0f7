//! What a camera must not do: change its size, freeze, go back in time, be the other camera.

use std::collections::VecDeque;

use i2ris::units::Nanos;

use super::{Frame, Gap, Shot, raw::Size};

/// Looks at the pictures of one view one after the other and turns those that cannot be trusted
/// into gaps.
#[derive(Debug, Default)]
pub struct Guard {
    size: Option<Size>,
    last_stamp: Option<Nanos>,
    last_digest: Option<u64>,
}

impl Guard {
    /// Digest of the newest picture of the right size; `None` before the first.
    #[must_use]
    pub fn digest(&self) -> Option<u64> {
        self.last_digest
    }

    /// A picture whose size differs from the first one's, that was not taken after the one before,
    /// or that is identical to it becomes a gap. A sensor has noise: two identical pictures are one
    /// picture twice.
    pub fn check(&mut self, shot: Shot) -> Shot {
        match shot {
            Shot::Frame(frame) => match self.fault(&frame) {
                Some(cause) => Shot::Gap {
                    stamp: frame.stamp,
                    name: frame.name,
                    cause,
                },
                None => Shot::Frame(frame),
            },
            gap @ Shot::Gap { .. } => gap,
        }
    }

    fn fault(&mut self, frame: &Frame) -> Option<Gap> {
        let size = Size {
            width: frame.picture.width(),
            height: frame.picture.height(),
        };
        if *self.size.get_or_insert(size) != size {
            return Some(Gap::WrongSize);
        }
        let digest = frame.picture.digest();
        let is_frozen = self.last_digest.replace(digest) == Some(digest);
        if self.last_stamp.is_some_and(|last| frame.stamp <= last) {
            return Some(Gap::OutOfOrder);
        }
        self.last_stamp = Some(frame.stamp);
        is_frozen.then_some(Gap::Frozen)
    }
}

/// Tells when both views show the same camera.
///
/// Two programs that read one camera need not get the same pictures of it, so one identical picture
/// puts all under suspicion for a while.
#[derive(Debug, Default)]
pub struct Twins {
    recent: [VecDeque<u64>; 2],
    suspicion: u32,
}

/// Pictures of each view that are remembered.
const REMEMBERED: usize = 16;
/// Pictures without another match until the suspicion ends.
const SUSPICION: u32 = 128;

impl Twins {
    /// Notes a picture of `view` (0 or 1) and says whether both views are under suspicion.
    pub fn are_one(&mut self, view: usize, digest: u64) -> bool {
        let [first, second] = &mut self.recent;
        let (own, other) = if view == 0 {
            (first, second)
        } else {
            (second, first)
        };
        self.suspicion = if other.contains(&digest) {
            SUSPICION
        } else {
            self.suspicion.saturating_sub(1)
        };
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
    use crate::image::Grey;

    fn shot(stamp: u64, size: usize, value: u8) -> Shot {
        let picture = Grey::new(size, size, vec![value; size * size]).unwrap();
        Shot::Frame(Frame {
            stamp: Nanos(stamp),
            name: "x".into(),
            picture,
        })
    }

    fn causes(shots: impl IntoIterator<Item = Shot>) -> Vec<Option<Gap>> {
        let mut guard = Guard::default();
        let cause = |shot| match shot {
            Shot::Frame(_) => None,
            Shot::Gap { cause, .. } => Some(cause),
        };
        shots
            .into_iter()
            .map(|shot| cause(guard.check(shot)))
            .collect()
    }

    #[test]
    fn good_pictures_pass() {
        assert_eq!(
            causes([shot(1, 8, 1), shot(2, 8, 2), shot(3, 8, 1)]),
            [None; 3]
        );
    }

    #[test]
    fn a_frozen_camera_is_named_until_it_moves_again() {
        let found = causes([shot(1, 8, 1), shot(2, 8, 1), shot(3, 8, 1), shot(4, 8, 2)]);
        assert_eq!(found, [None, Some(Gap::Frozen), Some(Gap::Frozen), None]);
    }

    #[test]
    fn another_size_is_named_and_the_first_one_stays_the_right_one() {
        assert_eq!(
            causes([shot(1, 8, 1), shot(2, 9, 2), shot(3, 8, 3)]),
            [None, Some(Gap::WrongSize), None]
        );
    }

    #[test]
    fn stamps_must_rise() {
        let found = causes([shot(5, 8, 1), shot(5, 8, 2), shot(4, 8, 3), shot(6, 8, 4)]);
        assert_eq!(
            found,
            [None, Some(Gap::OutOfOrder), Some(Gap::OutOfOrder), None]
        );
    }

    #[test]
    fn one_camera_in_both_views_is_noticed_though_each_view_misses_every_other_picture() {
        let mut twins = Twins::default();
        let mut suspected = 0;
        for picture in 0..200_u64 {
            // Each view gets two of three pictures.
            for view in 0..2 {
                suspected +=
                    usize::from((picture + view) % 3 != 0 && twins.are_one(view as usize, picture));
            }
        }
        assert!(suspected > 250, "{suspected}");
    }

    #[test]
    fn two_cameras_are_two_and_a_single_match_is_forgotten() {
        let mut twins = Twins::default();
        assert!((0..100).all(|i| !twins.are_one((i % 2) as usize, i)));
        assert!(twins.are_one(1, 98) && twins.are_one(0, 1000));
        assert!(
            (0..200)
                .map(|i| twins.are_one((i % 2) as usize, 2000 + i))
                .any(|one| !one)
        );
    }
}
