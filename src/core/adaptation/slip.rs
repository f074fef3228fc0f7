//! Slip: a zero that has jumped, as opposed to single outliers and to a push.
//!
//! After a jump all frames are refused, because the filter is sure of itself. If the refused frames
//! agree with one another and are not far away, the zero has slipped, and the filter is opened. A
//! step beyond the limit is taken to be a push from outside, or a wrong camera, and is not
//! followed.

use serde::{Deserialize, Serialize};

use super::excitation::forget;
use super::settings::{DEG, length};
use crate::core::drift::Pair;

/// Time over which frames are averaged, s.
const TIME_CONSTANT_S: f64 = 1.0;

/// How long frames have to agree, s.
const AGREED_S: f64 = 0.5;

/// Square of the mean over the mean square, reached by frames that agree.
const AGREEMENT: f64 = 0.8;

/// Smaller steps are followed without this, rad.
const MIN_STEP: f64 = 0.3 * DEG;

/// Averages of the innovations.
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
