//! The jerk limit: a mean over the last ticks.
//!
//! What goes in has a limited acceleration. In the mean over `n` ticks of length `T`, acceleration
//! changes per tick by the difference of two accelerations over `n`: between `-A` and `A`, the jerk
//! is at most `2 A / (n T)` (L. Biagiotti and C. Melchiorri, Trajectory Planning for Automatic
//! Machines and Robots, 2008: trajectories by filters). A mean stays within the limits on position,
//! velocity and acceleration that its values keep. It is late by `(n - 1) / 2` ticks, and comes to
//! rest `n - 1` ticks after what goes in.

use serde::{Deserialize, Serialize};

use crate::units::LONGEST_WINDOW;

/// The last values, and how many of them count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Smooth {
    /// The newest at `ticks % window`.
    past: [f64; LONGEST_WINDOW],
    ticks: u32,
    /// Ticks; 1: what goes in comes out.
    window: u32,
    mean: f64,
    moved: f64,
}

impl Smooth {
    /// At rest at 0. A window beyond 1 to [`LONGEST_WINDOW`] is cut.
    pub fn new(window: u32) -> Self {
        let window = window.clamp(1, LONGEST_WINDOW as u32);
        Self {
            past: [0.0; LONGEST_WINDOW],
            ticks: 0,
            window,
            mean: 0.0,
            moved: 0.0,
        }
    }

    /// Begins anew at rest at a value.
    pub fn restart(&mut self, value: f64) {
        self.past = [value; LONGEST_WINDOW];
        (self.mean, self.moved) = (value, 0.0);
    }

    /// Takes in the value of this tick.
    pub fn take(&mut self, value: f64) {
        self.ticks = (self.ticks + 1) % self.window;
        if let Some(place) = self.past.get_mut(self.ticks as usize) {
            *place = value;
        }
        // From the newest on, so that the mean of equal values is that value to the last digit.
        let others: f64 = self.counted().map(|past| past - value).sum();
        let mean = value + others / f64::from(self.window);
        self.moved = mean - self.mean;
        self.mean = mean;
    }

    /// The mean.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// How far the mean moved in the last tick.
    pub fn moved(&self) -> f64 {
        self.moved
    }

    /// All values that count are the same, and the mean has arrived at them.
    pub fn at_rest(&self) -> bool {
        self.moved == 0.0 && self.counted().all(|past| *past == self.mean)
    }

    fn counted(&self) -> impl Iterator<Item = &f64> {
        self.past.iter().take(self.window as usize)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::config::LimitConfig;
    use crate::core::motion::velocity_limit::{Limiter, Limits, Target};
    use crate::units::Nanos;

    proptest! {
        /// Goals that jump, and stops, through the limiter of a motor.
        #[test]
        fn the_jerk_of_a_motor_stays_within_its_limit(
            acts in prop::collection::vec((prop::option::of(-300.0..300.0_f64), 1..60_u32), 1..20), jerk in 7e7..1e9_f64,
        ) {
            let tick = Nanos::from_millis(1);
            let config = LimitConfig { jerk_counts_s3: Some(jerk), ..LimitConfig::default() };
            let limits = Limits {
                velocity: config.velocity_counts_s,
                acceleration: config.acceleration_counts_s2,
                deceleration: config.stop_deceleration_counts_s2,
                lowest: -200.0,
                highest: 200.0,
            };
            let (mut limiter, mut smooth) = (Limiter::new(&limits, tick), Smooth::new(config.window_ticks(tick).unwrap()));
            let (mut moved, mut change) = (0.0, 0.0);
            for (goal, ticks) in acts {
                for _ in 0..ticks {
                    match goal {
                        Some(goal) => limiter.follow(Target::fixed(goal)),
                        None => limiter.stop(),
                    }
                    smooth.take(limiter.position());
                    let third = smooth.moved() - moved - change;
                    prop_assert!(third.abs() <= jerk * 1e-9 * (1.0 + 1e-9) + 1e-9, "{third}");
                    prop_assert!(smooth.mean().abs() <= 200.0 + 1e-9);
                    (moved, change) = (smooth.moved(), smooth.moved() - moved);
                }
            }
        }
    }

    #[test]
    fn a_ramp_comes_out_late_by_half_the_window_and_ends_to_the_last_digit() {
        let mut smooth = Smooth::new(9);
        smooth.restart(0.1);
        assert!(smooth.at_rest());
        for k in 0..40 {
            smooth.take(0.1 + f64::from(k.min(20)));
            let late = 0.1 + (f64::from(k) - 4.0);
            assert!(!(8..=20).contains(&k) || (smooth.mean() - late).abs() < 1e-12);
            assert_eq!(smooth.at_rest(), k == 0 || k > 28, "{k}");
        }
        assert_eq!(smooth.mean(), 20.1);
    }

    #[test]
    fn a_window_of_one_changes_nothing() {
        let mut smooth = Smooth::new(1);
        for value in [0.3, -7.1, 0.1 + 0.2] {
            smooth.take(value);
            assert_eq!(smooth.mean(), value);
        }
    }
}
