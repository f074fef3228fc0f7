//! Score: adapted against calibrated, on the same frames.

use serde::{Deserialize, Serialize};

use super::settings::{DEG, length};
use crate::core::drift::Pair;
use crate::units::Nanos;

/// Length of a window.
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
const LARGEST: f64 = 3.0 * DEG;

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
    /// Root mean squares of the last window, rad.
    last: Pair,
}

impl Score {
    /// Adds the errors of a frame. Returns whether the adapted model must be reverted.
    pub(super) fn add(&mut self, calibrated: Pair, adapted: Pair, now: Nanos) -> bool {
        let begun = *self.begun.get_or_insert(now);
        self.frames += 1;
        for (sum, error) in self.sums.iter_mut().zip([calibrated, adapted]) {
            let error = length(error).min(LARGEST);
            *sum += error * error;
        }
        if now.duration_since(begun) < WINDOW || self.frames < MIN_FRAMES {
            return false;
        }
        self.last = self.sums.map(|sum| (sum / f64::from(self.frames)).sqrt());
        let [calibrated, adapted] = self.last;
        self.was_better |= adapted < BETTER * calibrated;
        let is_worse = adapted > (1.0 + MARGIN_SHARE) * calibrated + MARGIN;
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

    /// Root mean square errors of the last window: calibrated, adapted; rad.
    pub(super) fn last(&self) -> Pair {
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often frames of 30 Hz revert it in some seconds, with errors in degrees.
    fn run(score: &mut Score, start_s: u64, seconds: u64, errors: Pair) -> usize {
        let frames = (0..seconds * 30).map(|k| Nanos::from_millis(start_s * 1000 + k * 1000 / 30));
        frames.filter(|now| score.add([errors[0] * DEG, 0.0], [0.0, errors[1] * DEG], *now)).count()
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
            assert!(!score.add([1.0, 0.0], [1.0, 0.0], now));
        }
    }
}
