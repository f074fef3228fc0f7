//! The way of `move_jp`: from rest to rest along a straight line in joint space, with limited
//! velocity, acceleration and jerk.
//!
//! Seven segments of constant jerk, `+ 0 - 0 - 0 +` (L. Biagiotti and C. Melchiorri, Trajectory
//! Planning for Automatic Machines and Robots, 2008, section 3.4), in closed form because both ends
//! are at rest. No crate is used for it: the ones for Rust that are kept up solve the general
//! problem, from any state to any other with several axes in step, in thousands of lines.

use serde::{Deserialize, Serialize};

use crate::config::MoveConfig;

/// A way from 0 to `length`, as a function of time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Profile {
    length: f64,
    jerk: f64,
    /// Time with jerk, seconds.
    jerk_s: f64,
    /// Time with constant acceleration, seconds.
    steady_s: f64,
    /// Time with constant velocity, seconds.
    cruise_s: f64,
}

/// Largest velocity, acceleration and jerk.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    /// Per second, above 0.
    pub velocity: f64,
    /// Per second squared, above 0.
    pub acceleration: f64,
    /// Per second cubed, above 0.
    pub jerk: f64,
}

impl Bounds {
    /// As configured, rad.
    pub fn new(config: &MoveConfig) -> Self {
        Self {
            velocity: config.velocity_deg_s.to_radians(),
            acceleration: config.acceleration_deg_s2.to_radians(),
            jerk: config.jerk_deg_s3.to_radians(),
        }
    }
}

impl Profile {
    /// The fastest way of this length within bounds.
    pub fn new(length: f64, bounds: &Bounds) -> Self {
        let Bounds {
            velocity,
            acceleration,
            jerk,
        } = *bounds;
        let jerk_s = (acceleration / jerk).min((velocity / jerk).sqrt());
        let steady_s = (velocity / (jerk * jerk_s) - jerk_s).max(0.0);
        let top = jerk * jerk_s * (jerk_s + steady_s);
        let to_top_and_back = top * (2.0 * jerk_s + steady_s);
        if length >= to_top_and_back {
            return Self {
                length,
                jerk,
                jerk_s,
                steady_s,
                cruise_s: (length - to_top_and_back) / top,
            };
        }
        // The velocity is not reached; perhaps the acceleration is.
        let steady_s =
            ((jerk_s * jerk_s + 4.0 * length / (jerk * jerk_s)).sqrt() - 3.0 * jerk_s) / 2.0;
        if steady_s >= 0.0 {
            return Self {
                length,
                jerk,
                jerk_s,
                steady_s,
                cruise_s: 0.0,
            };
        }
        Self {
            length,
            jerk,
            jerk_s: (length / (2.0 * jerk)).cbrt(),
            steady_s: 0.0,
            cruise_s: 0.0,
        }
    }

    /// How long it takes, seconds.
    pub fn duration_s(&self) -> f64 {
        4.0 * self.jerk_s + 2.0 * self.steady_s + self.cruise_s
    }

    /// How far the way has come, 0 to 1.
    pub fn share(&self, time_s: f64) -> f64 {
        if time_s >= self.duration_s() || self.length <= 0.0 {
            return 1.0;
        }
        let segments = [
            (self.jerk_s, 1.0),
            (self.steady_s, 0.0),
            (self.jerk_s, -1.0),
            (self.cruise_s, 0.0),
            (self.jerk_s, -1.0),
            (self.steady_s, 0.0),
            (self.jerk_s, 1.0),
        ];
        let (mut left, mut place, mut velocity, mut acceleration) =
            (time_s.max(0.0), 0.0, 0.0, 0.0);
        for (span, sign) in segments {
            let (dt, jerk) = (left.min(span), sign * self.jerk);
            place += dt * (velocity + dt * (acceleration / 2.0 + dt * jerk / 6.0));
            velocity += dt * (acceleration + dt * jerk / 2.0);
            acceleration += dt * jerk;
            left -= dt;
        }
        (place / self.length).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Differences over short times stay within the bounds, and the way ends where it should,
        /// at rest.
        #[test]
        fn every_way_keeps_its_bounds_and_arrives(
            length in 1e-6..100.0_f64, velocity in 0.1..50.0_f64, acceleration in 0.1..500.0_f64, jerk in 1.0..1e4_f64
        ) {
            let profile = Profile::new(length, &Bounds { velocity, acceleration, jerk });
            let (steps, duration) = (2000, profile.duration_s());
            prop_assert!(duration > 0.0 && duration.is_finite());
            let h = duration / f64::from(steps);
            let at = |k: i32| length * profile.share(f64::from(k) * h);
            prop_assert!(at(0) == 0.0 && (at(steps) - length).abs() <= 1e-9 * length && profile.share(1.01 * duration) == 1.0);
            // What the rounding of places leaves of a derivative.
            let rounding = |order: i32| 1e-12 * length.max(1.0) / h.powi(order);
            for k in 0..steps {
                let first = (at(k + 1) - at(k)) / h;
                prop_assert!(first >= -rounding(1) && first <= velocity * (1.0 + 1e-9) + rounding(1), "{first}");
                let second = (at(k + 1) - 2.0 * at(k) + at(k - 1)) / (h * h);
                prop_assert!(second.abs() <= acceleration * (1.0 + 1e-6) + rounding(2), "{second}");
                let third = (at(k + 2) - 3.0 * at(k + 1) + 3.0 * at(k) - at(k - 1)) / (h * h * h);
                prop_assert!(third.abs() <= jerk * (1.0 + 1e-3) + 8.0 * rounding(3), "{third} of {jerk}");
            }
        }
    }

    #[test]
    fn a_long_way_takes_its_length_over_the_velocity_and_the_time_to_get_there() {
        let bounds = Bounds {
            velocity: 10.0,
            acceleration: 100.0,
            jerk: 2000.0,
        };
        // V/A + A/J = 0.1 s + 0.05 s.
        assert!((Profile::new(20.0, &bounds).duration_s() - 2.15).abs() < 1e-12);
    }

    #[test]
    fn no_way_is_over_at_once() {
        let bounds = Bounds {
            velocity: 10.0,
            acceleration: 100.0,
            jerk: 2000.0,
        };
        assert_eq!(Profile::new(0.0, &bounds).share(0.0), 1.0);
    }
}
