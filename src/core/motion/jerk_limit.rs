//! Jerk limit: a moving average over the last ticks.
//!
//! The input has a limited acceleration. In the average over `n` ticks of length `T`, the
//! acceleration changes per tick by the difference of two accelerations over `n`. With
//! accelerations between `-A` and `A`, the jerk is at most `2 A / (n T)` (L. Biagiotti and
//! C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008: trajectories by
//! filters). The average keeps the limits on position, velocity and acceleration of its input. It
//! lags by `(n - 1) / 2` ticks and comes to rest `n - 1` ticks after its input.

use serde::{Deserialize, Serialize};

use crate::units::MAX_WINDOW_TICKS;

/// Moving average.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct JerkLimiter {
    /// The newest value is at `ticks % window`.
    past: [f64; MAX_WINDOW_TICKS],
    ticks: u32,
    /// Ticks; with 1, the output is the input.
    window: u32,
    pub output: f64,
    pub increment: f64,
}

impl JerkLimiter {
    /// At rest at 0. The window is clamped to 1 to [`MAX_WINDOW_TICKS`].
    pub(super) fn new(window: u32) -> Self {
        let window = window.clamp(1, MAX_WINDOW_TICKS as u32);
        Self { past: [0.0; MAX_WINDOW_TICKS], ticks: 0, window, output: 0.0, increment: 0.0 }
    }

    /// Starts again at rest at a value.
    pub(super) fn restart(&mut self, value: f64) {
        self.past = [value; MAX_WINDOW_TICKS];
        (self.output, self.increment) = (value, 0.0);
    }

    /// Takes the value of this tick.
    pub(super) fn update(&mut self, value: f64) {
        self.ticks = (self.ticks + 1) % self.window;
        if let Some(newest) = self.past.get_mut(self.ticks as usize) {
            *newest = value;
        }
        // Relative to the newest value, so that the average of equal values is exact.
        let others: f64 = self.values().map(|past| past - value).sum();
        let output = value + others / f64::from(self.window);
        self.increment = output - self.output;
        self.output = output;
    }

    /// All values in the window are the same, and the output has reached them.
    pub(super) fn is_at_rest(&self) -> bool {
        self.increment == 0.0 && self.values().all(|past| *past == self.output)
    }

    /// All values in the window are less than a count from the output.
    pub(crate) fn is_settled(&self) -> bool {
        self.values().all(|past| (past - self.output).abs() < 1.0)
    }

    fn values(&self) -> impl Iterator<Item = &f64> {
        self.past.iter().take(self.window as usize)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::config::LimitConfig;
    use crate::core::motion::velocity_limit::{MotorLimits, MotorTarget, VelocityLimiter};
    use crate::units::Nanos;

    proptest! {
        /// Goals that jump, and stops, through the limiter of a motor.
        #[test]
        fn the_jerk_of_a_motor_stays_within_its_limit(
            acts in prop::collection::vec(
                (prop::option::of(-300.0..300.0_f64), 1..60_u32), 1..20
            ),
            jerk in 7e7..1e9_f64,
        ) {
            let tick = Nanos::from_millis(1);
            let config = LimitConfig { jerk_counts_s3: Some(jerk), ..LimitConfig::default() };
            let limits = MotorLimits {
                velocity: config.velocity_counts_s,
                acceleration: config.acceleration_counts_s2,
                deceleration: config.stop_deceleration_counts_s2,
                lowest: -200.0,
                highest: 200.0,
            };
            let mut limiter = VelocityLimiter::new(&limits, tick);
            let mut jerk_limiter = JerkLimiter::new(config.window_ticks(tick).unwrap());
            let (mut moved, mut change) = (0.0, 0.0);
            for (goal, ticks) in acts {
                for _ in 0..ticks {
                    match goal {
                        Some(goal) => limiter.track(MotorTarget::fixed(goal)),
                        None => limiter.stop(),
                    }
                    jerk_limiter.update(limiter.position());
                    let third = jerk_limiter.increment - moved - change;
                    prop_assert!(third.abs() <= jerk * 1e-9 * (1.0 + 1e-9) + 1e-9, "{third}");
                    prop_assert!(jerk_limiter.output.abs() <= 200.0 + 1e-9);
                    (moved, change) = (jerk_limiter.increment, jerk_limiter.increment - moved);
                }
            }
        }
    }

    #[test]
    fn a_ramp_lags_by_half_the_window_and_ends_exactly() {
        let mut jerk_limiter = JerkLimiter::new(9);
        jerk_limiter.restart(0.1);
        assert!(jerk_limiter.is_at_rest());
        for k in 0..40 {
            jerk_limiter.update(0.1 + f64::from(k.min(20)));
            let late = 0.1 + (f64::from(k) - 4.0);
            assert!(!(8..=20).contains(&k) || (jerk_limiter.output - late).abs() < 1e-12);
            assert_eq!(jerk_limiter.is_at_rest(), k == 0 || k > 28, "{k}");
        }
        assert_eq!(jerk_limiter.output, 20.1);
    }

    #[test]
    fn a_window_of_one_changes_nothing() {
        let mut jerk_limiter = JerkLimiter::new(1);
        for value in [0.3, -7.1, 0.1 + 0.2] {
            jerk_limiter.update(value);
            assert_eq!(jerk_limiter.output, value);
        }
    }
}
