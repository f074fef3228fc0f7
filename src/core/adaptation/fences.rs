//! Three fences of the adaptation: conditions that pause learning, the score of adapted against
//! calibrated on the same frames, and slips of the zero.

use serde::{Deserialize, Serialize};

use super::excitation::forget;
use super::{DEG, Pause, Pauses, length};
use crate::core::drift::Pair;
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

const WINDOW: Nanos = Nanos::from_millis(10_000);

/// Minimum frames of a window; with fewer, it stays open.
const MIN_FRAMES: u32 = 20;

/// Number of windows with a worse adapted model before it is reverted; a window that is not worse
/// subtracts one.
const WORSE_WINDOWS: u8 = 3;

/// Margins within which the adapted model is not worse, rad and as a share: a push from outside,
/// which adds to both errors, must not revert it.
const MARGIN: f64 = 0.02 * DEG;
const MARGIN_SHARE: f64 = 0.05;

/// Share of the calibrated error below which the adapted model is better in a window.
const BETTER: f64 = 0.8;

/// Larger errors count as this, rad: one outlier decides no window.
const LARGEST_ERROR: f64 = 3.0 * DEG;

/// The errors of the present window, and of the last one.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Score {
    begun: Option<Nanos>,
    frames: u32,
    /// Sums of squares: calibrated, adapted.
    sums: Pair,
    worse: u8,
    was_better: bool,
    /// Accepted frames of all windows.
    accepted: u32,
    refused: u32,
    /// Root mean square errors of the last window: calibrated, adapted; rad.
    pub last: Pair,
}

impl Score {
    /// Adds the errors of a frame: calibrated, adapted. Returns whether the adapted model must be
    /// reverted. One that `was_reverted` does not lose again: it stays while the goal rests.
    pub(super) fn add(&mut self, errors: [Pair; 2], was_reverted: bool, now: Nanos) -> bool {
        let begun = *self.begun.get_or_insert(now);
        self.frames += 1;
        for (sum, error) in self.sums.iter_mut().zip(errors) {
            let error = length(error).min(LARGEST_ERROR);
            *sum += error * error;
        }
        if now.duration_since(begun) < WINDOW || self.frames < MIN_FRAMES {
            return false;
        }
        self.last = self.sums.map(|sum| (sum / f64::from(self.frames)).sqrt());
        let [calibrated, adapted] = self.last;
        self.was_better |= adapted < BETTER * calibrated;
        let is_worse = !was_reverted && adapted > (1.0 + MARGIN_SHARE) * calibrated + MARGIN;
        self.worse = if is_worse { self.worse + 1 } else { self.worse.saturating_sub(1) };
        (self.begun, self.frames, self.sums) = (None, 0, [0.0; 2]);
        let is_reverted = self.worse >= WORSE_WINDOWS;
        self.worse = if is_reverted { 0 } else { self.worse };
        is_reverted
    }

    /// The present window is thrown away: it would mix two states.
    pub(super) fn restart(&mut self) {
        (self.begun, self.frames, self.sums) = (None, 0, [0.0; 2]);
    }

    /// Counts a frame that was learned from, or refused.
    pub(super) fn count(&mut self, is_accepted: bool) {
        let count = if is_accepted { &mut self.accepted } else { &mut self.refused };
        *count = count.saturating_add(1);
    }

    /// Whether the adapted model failed from the start, misled by its first frames: it was better
    /// in no window and refused most frames.
    pub(crate) fn failed_from_start(&self) -> bool {
        !self.was_better && self.refused > self.accepted
    }
}

/// Time over which frames are averaged, s.
const TIME_CONSTANT_S: f64 = 1.0;

/// How long frames have to agree, s.
const AGREED_S: f64 = 0.5;

/// Square of the mean over the mean square, reached by frames that agree.
const AGREEMENT: f64 = 0.8;

/// Smaller steps are followed without this, rad.
const MIN_STEP: f64 = 0.3 * DEG;

/// Finds a zero that has jumped, as opposed to single outliers and to a push.
///
/// After a jump all frames are refused, because the filter is sure of itself. If the refused frames
/// agree with one another and are not far away, the zero has slipped, and the filter is opened. A
/// step beyond the limit is taken to be a push from outside, or a wrong camera, and is not
/// followed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct SlipDetector {
    mean: Pair,
    mean_square: f64,
    agreed_s: f64,
}

impl SlipDetector {
    /// Adds an innovation. Returns the step of a slip that has just been found, rad.
    pub(super) fn add(
        &mut self,
        innovation: Pair,
        model: f64,
        largest_step: f64,
        seconds: f64,
    ) -> Option<f64> {
        for (mean, value) in self.mean.iter_mut().zip(innovation) {
            *mean = forget(*mean, value, TIME_CONSTANT_S, seconds);
        }
        let square = innovation[0] * innovation[0] + innovation[1] * innovation[1];
        self.mean_square = forget(self.mean_square, square, TIME_CONSTANT_S, seconds);
        let step = length(self.mean);
        let agrees = step * step >= AGREEMENT * self.mean_square;
        let is_slip = agrees && step >= MIN_STEP.max(model) && step <= largest_step;
        self.agreed_s = if is_slip { self.agreed_s + seconds } else { 0.0 };
        if self.agreed_s < AGREED_S {
            return None;
        }
        *self = Self::default();
        Some(step)
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

    /// How often frames of 30 Hz revert it in some seconds, with errors in degrees.
    fn run(score: &mut Score, start_s: u64, seconds: u64, errors: Pair) -> usize {
        let frames = (0..seconds * 30).map(|k| Nanos::from_millis(start_s * 1000 + k * 1000 / 30));
        let errors = [[errors[0] * DEG, 0.0], [0.0, errors[1] * DEG]];
        frames.filter(|now| score.add(errors, false, *now)).count()
    }

    #[test]
    fn three_worse_windows_revert_the_correction() {
        let mut score = Score::default();
        assert_eq!(run(&mut score, 1, 25, [0.5, 0.6]), 0);
        score.restart();
        // A window that is not worse takes one away.
        assert_eq!(run(&mut score, 30, 12, [0.5, 0.4]), 0);
        score.restart();
        assert_eq!(run(&mut score, 60, 35, [0.5, 0.6]), 1);
    }

    #[test]
    fn better_model_did_not_fail_from_the_start() {
        let mut score = Score::default();
        run(&mut score, 1, 25, [0.5, 0.45]);
        score.count(true);
        score.count(false);
        assert!(!score.failed_from_start());
        score.count(false);
        assert!(score.failed_from_start());
        run(&mut score, 30, 12, [0.5, 0.3]);
        run(&mut score, 60, 35, [0.5, 0.6]);
        assert!(!score.failed_from_start());
    }

    #[test]
    fn equal_errors_and_outliers_revert_nothing() {
        let mut score = Score::default();
        assert_eq!(run(&mut score, 1, 100, [0.5, 0.54]), 0);
        for second in 0..100 {
            assert_eq!(run(&mut score, 200 + second, 1, [0.5, 0.4]), 0);
            let now = Nanos::from_millis((200 + second) * 1000 + 990);
            // A wrong frame is as far from the one pose as from the other.
            assert!(!score.add([[1.0, 0.0]; 2], false, now));
        }
    }

    const FRAME_S: f64 = 1.0 / 30.0;

    fn found(steps: impl Iterator<Item = Pair>) -> Vec<f64> {
        let mut slip = SlipDetector::default();
        steps
            .filter_map(|step| slip.add(step.map(|deg| deg * DEG), 0.2 * DEG, 1.5 * DEG, FRAME_S))
            .collect()
    }

    #[test]
    fn a_step_of_a_degree_is_found_within_three_seconds() {
        let steps = found((0..90).map(|k| [0.7 + 0.1 * f64::from(k % 3), -0.7]));
        assert!((0.5..1.2).contains(&(steps[0] / DEG)), "{steps:?}");
    }

    #[test]
    fn two_degree_push_and_outliers_are_not_a_slip() {
        assert!(found((0..900).map(|_| [2.0, 0.0])).is_empty());
        assert!(found((0..900).map(|k| [if k % 10 == 0 { 5.0 } else { 0.1 }, 0.0])).is_empty());
        // Errors that alternate.
        assert!(found((0..900).map(|k| [(0.1 * f64::from(k)).sin(), 0.0])).is_empty());
    }
}
