//! Joint trajectory of `move_jp`: a straight line in joint space, from rest to rest.
//!
//! A trajectory that replaces another begins where the first can come to rest soonest. Both
//! together are one motion without a jump, within the same limits.

use serde::{Deserialize, Serialize};

use crate::core::vector::{distance, interpolate};
use crate::units::{Nanos, OutputVec};

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct JointTrajectory {
    pub client_id: u64,
    /// The line that comes to rest before this one starts, if there is any.
    before: Option<Line>,
    line: Line,
}

/// A straight line from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Line {
    /// rad.
    from: OutputVec,
    to: OutputVec,
    curve: SCurve,
    started: Nanos,
}

impl Line {
    /// The fastest motion within the limits.
    fn new(from: OutputVec, to: OutputVec, limits: &TrajectoryLimits, started: Nanos) -> Self {
        Self { from, to, curve: SCurve::new(distance(&to, &from), limits), started }
    }

    /// The same motion until `now`, and to rest as soon as the limits allow it.
    fn shortened(&self, now: Nanos) -> Self {
        let curve = self.curve.shortened(now.duration_since(self.started).as_seconds());
        let share = curve.length / self.curve.length;
        let to = if share < 1.0 { interpolate(&self.from, &self.to, share) } else { self.to };
        Self { curve, to, ..*self }
    }

    fn position_at(&self, now: Nanos) -> OutputVec {
        let fraction = self.curve.fraction(now.duration_since(self.started).as_seconds());
        interpolate(&self.from, &self.to, fraction)
    }

    fn ends(&self) -> Nanos {
        self.started + Nanos((self.curve.duration_s() * 1e9).ceil() as u64)
    }
}

impl JointTrajectory {
    /// The fastest trajectory within the limits, starting now.
    pub(crate) fn new(
        client_id: u64,
        from: OutputVec,
        to: OutputVec,
        limits: &TrajectoryLimits,
        now: Nanos,
    ) -> Self {
        Self { client_id, before: None, line: Line::new(from, to, limits, now) }
    }

    /// This trajectory until now, then to rest, and from there to another end.
    pub(crate) fn redirected_to(
        &self,
        to: OutputVec,
        limits: &TrajectoryLimits,
        now: Nanos,
    ) -> Self {
        let before = match self.before {
            Some(before) if now < self.line.started => before,
            _ => self.line.shortened(now),
        };
        let line = Line::new(before.to, to, limits, before.ends().max(now));
        Self { before: Some(before), line, ..*self }
    }

    pub(crate) fn end_time(&self) -> Nanos {
        self.line.ends()
    }

    /// Position at a time, rad.
    pub(crate) fn position_at(&self, now: Nanos) -> OutputVec {
        let before = self.before.filter(|_| now < self.line.started);
        before.unwrap_or(self.line).position_at(now)
    }

    /// The corners of the way that is left, rad.
    pub(crate) fn way_left(&self, now: Nanos) -> [OutputVec; 3] {
        let here = self.position_at(now);
        [here, if now < self.line.started { self.line.from } else { here }, self.line.to]
    }

    /// Start of the line to the end, rad.
    pub(crate) fn start(&self) -> &OutputVec {
        &self.line.from
    }

    /// End, rad.
    pub(crate) fn end(&self) -> &OutputVec {
        &self.line.to
    }

    pub(crate) fn is_finished(&self, now: Nanos) -> bool {
        now >= self.end_time()
    }
}

/// S-curve: motion from rest at 0 to rest at `length`, as a function of time.
///
/// Seven segments of constant jerk, `+ 0 - 0 - 0 +` (L. Biagiotti and C. Melchiorri, Trajectory
/// Planning for Automatic Machines and Robots, 2008, section 3.4), in closed form because both ends
/// are at rest. The maintained crates for Rust solve the general problem, from any state to any
/// other with several synchronised axes, in thousands of lines.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct SCurve {
    pub length: f64,
    jerk: f64,
    /// Duration of a segment with jerk, s.
    jerk_s: f64,
    /// Duration of constant acceleration, s.
    constant_acceleration_s: f64,
    /// Duration of constant velocity, s.
    cruise_s: f64,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct TrajectoryLimits {
    /// Per second, above 0.
    pub velocity: f64,
    /// Per second squared, above 0.
    pub acceleration: f64,
    /// Per second cubed, above 0.
    pub jerk: f64,
}

impl TrajectoryLimits {
    /// In rad and s, of `move_jp`: half of the joint limit, and at most 10 deg/s, which are reached
    /// in 0.15 s.
    pub(crate) fn new(limit_deg_s: Option<f64>) -> Self {
        let velocity = limit_deg_s.map_or(10.0, |limit| 10.0_f64.min(limit / 2.0)).to_radians();
        Self { velocity, acceleration: 10.0 * velocity, jerk: 200.0 * velocity }
    }
}

impl SCurve {
    /// The fastest motion over a length within the limits.
    pub(crate) fn new(length: f64, limits: &TrajectoryLimits) -> Self {
        let TrajectoryLimits { velocity, acceleration, jerk } = *limits;
        let jerk_s = (acceleration / jerk).min((velocity / jerk).sqrt());
        let constant_acceleration_s = (velocity / (jerk * jerk_s) - jerk_s).max(0.0);
        let peak = jerk * jerk_s * (jerk_s + constant_acceleration_s);
        let ramps = peak * (2.0 * jerk_s + constant_acceleration_s);
        if length >= ramps {
            return Self {
                length,
                jerk,
                jerk_s,
                constant_acceleration_s,
                cruise_s: (length - ramps) / peak,
            };
        }
        // The velocity limit is not reached; the acceleration limit may be.
        let constant_acceleration_s =
            ((jerk_s * jerk_s + 4.0 * length / (jerk * jerk_s)).sqrt() - 3.0 * jerk_s) / 2.0;
        if constant_acceleration_s >= 0.0 {
            return Self { length, jerk, jerk_s, constant_acceleration_s, cruise_s: 0.0 };
        }
        Self {
            length,
            jerk,
            jerk_s: (length / (2.0 * jerk)).cbrt(),
            constant_acceleration_s: 0.0,
            cruise_s: 0.0,
        }
    }

    /// The motion that is the same until a time, and then comes to rest as soon as it can: the
    /// acceleration ends at once, and there is no more cruise.
    pub(crate) fn shortened(&self, time_s: f64) -> Self {
        let constant_s = (time_s - self.jerk_s).clamp(0.0, self.constant_acceleration_s);
        let cruise_s = time_s - 2.0 * self.jerk_s - self.constant_acceleration_s;
        if cruise_s >= self.cruise_s {
            return *self;
        }
        let cruise_s = cruise_s.max(0.0);
        let jerk_s = time_s.clamp(0.0, self.jerk_s);
        let peak = self.jerk * jerk_s * (jerk_s + constant_s);
        Self {
            length: peak * (2.0 * jerk_s + constant_s + cruise_s),
            jerk_s,
            constant_acceleration_s: constant_s,
            cruise_s,
            ..*self
        }
    }

    pub(crate) fn duration_s(&self) -> f64 {
        4.0 * self.jerk_s + 2.0 * self.constant_acceleration_s + self.cruise_s
    }

    /// The part of the length that is done, 0 to 1.
    pub(crate) fn fraction(&self, time_s: f64) -> f64 {
        if time_s >= self.duration_s() || self.length <= 0.0 {
            return 1.0;
        }
        let segments = [
            (self.jerk_s, 1.0),
            (self.constant_acceleration_s, 0.0),
            (self.jerk_s, -1.0),
            (self.cruise_s, 0.0),
            (self.jerk_s, -1.0),
            (self.constant_acceleration_s, 0.0),
            (self.jerk_s, 1.0),
        ];
        let (mut left, mut position, mut velocity, mut acceleration) =
            (time_s.max(0.0), 0.0, 0.0, 0.0);
        for (span, sign) in segments {
            let (dt, jerk) = (left.min(span), sign * self.jerk);
            position += dt * (velocity + dt * (acceleration / 2.0 + dt * jerk / 6.0));
            velocity += dt * (acceleration + dt * jerk / 2.0);
            acceleration += dt * jerk;
            left -= dt;
        }
        (position / self.length).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn it_moves_on_a_straight_line_from_start_to_end() {
        let limits = TrajectoryLimits { velocity: 10.0, acceleration: 100.0, jerk: 2000.0 };
        let (from, to) = ([0.1, 0.2, 0.0], [0.3, 1.4, 0.0]);
        let started = Nanos::from_millis(1000);
        let trajectory = JointTrajectory::new(7, from, to, &limits, started);
        assert_eq!(trajectory.position_at(started), from);
        let mut ticks = 0;
        let mut now = started;
        while !trajectory.is_finished(now) {
            let position = trajectory.position_at(now);
            let (first, second) = (position[0] - from[0], position[1] - from[1]);
            assert!((second - 6.0 * first).abs() < 1e-12, "{position:?}");
            now = now + Nanos::from_millis(1);
            ticks += 1;
        }
        assert_eq!(trajectory.position_at(now), to);
        assert!((200..300).contains(&ticks), "{ticks}");
    }

    #[test]
    fn redirected_trajectory_continues_from_its_state() {
        let limits = TrajectoryLimits { velocity: 10.0, acceleration: 100.0, jerk: 2000.0 };
        let ms = |ms: u64| Nanos::from_millis(1000 + ms);
        let mut trajectory = JointTrajectory::new(7, [0.0; 3], [2.0, 1.0, 0.0], &limits, ms(0));
        let ends = [[-1.0, 2.0, 0.0], [0.5, 0.5, 0.0], [3.0, -1.0, 0.0], [1.0; 3], [0.0; 3]];
        // Before the first line rests, in the middle of the one that follows, and after its end.
        for (at, end) in [100, 120, 400, 430, 5000].into_iter().zip(ends) {
            let redirected_to = trajectory.redirected_to(end, &limits, ms(at));
            for after in 0..3 {
                let apart = distance(
                    &redirected_to.position_at(ms(at + after)),
                    &trajectory.position_at(ms(at + after)),
                );
                assert!(apart < [1e-12, 1e-4, 1e-3][after as usize], "{apart} at {at} + {after}");
            }
            trajectory = redirected_to;
        }
        assert_eq!(trajectory.position_at(trajectory.end_time()), [0.0; 3]);
    }

    proptest! {
        /// Finite differences stay within the limits, and the motion ends at its length, at rest.
        #[test]
        fn every_s_curve_keeps_its_limits_and_arrives(
            length in 1e-6..100.0_f64, velocity in 0.1..50.0_f64,
            acceleration in 0.1..500.0_f64, jerk in 1.0..1e4_f64
        ) {
            let curve = SCurve::new(length, &TrajectoryLimits { velocity, acceleration, jerk });
            let (steps, duration) = (2000, curve.duration_s());
            prop_assert!(duration > 0.0 && duration.is_finite());
            let h = duration / f64::from(steps);
            let at = |k: i32| length * curve.fraction(f64::from(k) * h);
            prop_assert!(at(0) == 0.0 && (at(steps) - length).abs() <= 1e-9 * length);
            prop_assert_eq!(curve.fraction(1.01 * duration), 1.0);
            // Error of a derivative by the rounding of positions.
            let rounding = |order: i32| 1e-12 * length.max(1.0) / h.powi(order);
            for k in 0..steps {
                let first = (at(k + 1) - at(k)) / h;
                let highest = velocity * (1.0 + 1e-9) + rounding(1);
                prop_assert!(first >= -rounding(1) && first <= highest, "{first}");
                let second = (at(k + 1) - 2.0 * at(k) + at(k - 1)) / (h * h);
                let highest = acceleration * (1.0 + 1e-6) + rounding(2);
                prop_assert!(second.abs() <= highest, "{second}");
                let third = (at(k + 2) - 3.0 * at(k + 1) + 3.0 * at(k) - at(k - 1)) / (h * h * h);
                let highest = jerk * (1.0 + 1e-3) + 8.0 * rounding(3);
                prop_assert!(third.abs() <= highest, "{third} of {jerk}");
            }
        }

        #[test]
        fn shortened_s_curve_follows_then_rests_soonest(
            length in 0.01..20.0_f64, share in 0.0..1.0_f64
        ) {
            let curve = SCurve::new(length, &LIMITS);
            let time = share * curve.duration_s();
            let short = curve.shortened(time);
            for k in 0..=20 {
                let at = time * f64::from(k) / 20.0;
                let apart = short.length * short.fraction(at) - length * curve.fraction(at);
                prop_assert!(apart.abs() < 1e-9, "{apart} at {at} of {time}");
            }
            let ramp = 3.0 * curve.jerk_s + curve.constant_acceleration_s;
            let longest = (time + ramp).min(curve.duration_s());
            prop_assert!(short.duration_s() <= longest + 1e-9, "{} {longest}", short.duration_s());
        }
    }

    const LIMITS: TrajectoryLimits =
        TrajectoryLimits { velocity: 10.0, acceleration: 100.0, jerk: 2000.0 };

    #[test]
    fn a_long_motion_takes_length_over_velocity_plus_the_ramps() {
        // V/A + A/J = 0.1 s + 0.05 s.
        assert!((SCurve::new(20.0, &LIMITS).duration_s() - 2.15).abs() < 1e-12);
    }

    #[test]
    fn zero_length_motion_ends_at_once() {
        assert_eq!(SCurve::new(0.0, &LIMITS).fraction(0.0), 1.0);
    }
}
