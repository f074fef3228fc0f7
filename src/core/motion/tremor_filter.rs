//! Tremor filter: a first-order low-pass filter on the goal of servo commands.
//!
//! It delays slow motion by its time constant, `1 / (2 pi f)`: 53 ms at 3 Hz. Hand tremor has 8 to
//! 12 Hz (C. N. Riviere et al. 1998); a 3 Hz filter passes a third of that.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use crate::core::vector::zip_map;
use crate::units::{Nanos, OutputVec};

/// The filter. The caller keeps its output.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct TremorFilter {
    /// Fraction of the distance to the goal that the output moves per tick; 1: off.
    gain: f64,
}

impl TremorFilter {
    /// With a cut-off frequency; 0: off.
    pub(super) fn new(cut_off_hz: f64, tick: Nanos) -> Self {
        let tick_s = tick.as_seconds();
        let gain =
            if cut_off_hz > 0.0 { tick_s / (tick_s + 1.0 / (TAU * cut_off_hz)) } else { 1.0 };
        Self { gain }
    }

    pub(super) fn is_off(&self) -> bool {
        self.gain >= 1.0
    }

    /// The next output for a goal.
    pub(super) fn filter(&self, last: &OutputVec, goal: &OutputVec) -> OutputVec {
        if self.is_off() {
            *goal
        } else {
            zip_map(last, goal, |last, goal| last + self.gain * (goal - last))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outputs for a goal as a function of time, at 1 kHz.
    fn run(cut_off_hz: f64, goal: impl Fn(f64) -> f64) -> Vec<f64> {
        let filter = TremorFilter::new(cut_off_hz, Nanos::from_millis(1));
        let mut output = [0.0; 3];
        let mut step = |k: u32| {
            output = filter.filter(&output, &[goal(f64::from(k) * 1e-3), 0.0, 0.0]);
            output[0]
        };
        (1..=2000).map(&mut step).collect()
    }

    #[test]
    fn tremor_is_attenuated_and_slow_motion_lags() {
        let ramp = run(3.0, |t| 10.0 * t);
        assert!((20.0 - ramp[1999] - 10.0 * 0.053).abs() < 0.02, "{}", ramp[1999]);
        let tremor = run(3.0, |t| (TAU * 10.0 * t).sin());
        let amplitude = tremor[1000..].iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        assert!((amplitude - 0.29).abs() < 0.02, "{amplitude}");
    }

    #[test]
    fn without_a_cut_off_the_goal_passes_unchanged() {
        assert_eq!(run(0.0, |t| 0.1 + t)[1999], 0.1 + 2000.0 * 1e-3);
    }
}
