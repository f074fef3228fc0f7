//! Goal extrapolation: the goal between two commands.
//!
//! Commands arrive as a staircase: at 200 Hz a new goal every five ticks. A setpoint that follows
//! the staircase stops on every stair and lags by half a stair on average; a limiter that must be
//! able to stop on a stair lags even more. Interpolation makes a smooth path but lags by a whole
//! stair; at 12 deg/s a stair of 5 ms is 0.06 deg. So the goal is **extrapolated**: it continues at
//! the rate between the last commands. Steady motion has no lag at all.
//!
//! The extrapolated goal may run ahead of the request. This is bounded:
//!
//! - per output, the smaller of the last two rates counts, or zero if their signs differ (the
//!   minmod of the slope limiters of fluid dynamics; P. L. Roe 1986). A step, a first command or a
//!   reversal is not extrapolated. A client that stays where it is stops the goal with its first
//!   command;
//! - extrapolation lasts at most [`HORIZON_INTERVALS`] intervals and [`MAX_EXTRAPOLATION`], so the
//!   goal of a client that dies is at rest a few stairs later, long before the deadline;
//! - streams slower than [`MAX_EXTRAPOLATION`] are not extrapolated.
//!
//! Two other kinds of goals are also lines in time, with a known rate: `servo_jv` is integrated
//! from where the goal is ([`GoalExtrapolation::moving`]), and `interpolate_jp` ends when the next
//! command is due ([`GoalExtrapolation::reaching`]). The line always ends: a client that dies
//! leaves the goal at rest.

use serde::{Deserialize, Serialize};

use crate::core::vector::{difference, zip_map};
use crate::units::{MAX_MOTORS, MAX_OUTPUTS, Nanos};

/// Late commands are normal on a desktop system. One interval of grace keeps the setpoint from
/// stopping for each of them.
const HORIZON_INTERVALS: f64 = 2.0;

/// 20 ms. A hand that accelerates with 10,000 counts/s^2 leaves the straight line by 2 counts in
/// that time.
const MAX_EXTRAPOLATION: Nanos = Nanos::from_millis(20);

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum ExtrapolatedGoal {
    /// Angles, rad.
    Joint(GoalExtrapolation<MAX_OUTPUTS>),
    /// Encoder positions, counts.
    Actuator(GoalExtrapolation<MAX_MOTORS>),
}

impl ExtrapolatedGoal {
    pub(crate) fn is_joint(&self) -> bool {
        matches!(self, Self::Joint(_))
    }
}

/// A goal of `N` values and its rate of change.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct GoalExtrapolation<const N: usize> {
    #[serde(with = "array")]
    pub goal: [f64; N],
    pub stamp: Nanos,
    /// Rate of change between the last two commands, 1/s; 0 if they were too far apart.
    #[serde(with = "array")]
    last_rate: [f64; N],
    /// Rate of the extrapolation, 1/s.
    #[serde(with = "array")]
    rate: [f64; N],
    /// Age of the last command at which the goal is `goal`, s; 0 unless the goal is interpolated.
    reached_s: f64,
    /// Duration of the extrapolation, s.
    horizon_s: f64,
}

impl<const N: usize> GoalExtrapolation<N> {
    pub(crate) fn first(goal: [f64; N], stamp: Nanos) -> Self {
        let (still, reached_s, horizon_s) = ([0.0; N], 0.0, 0.0);
        Self { goal, stamp, last_rate: still, rate: still, reached_s, horizon_s }
    }

    /// A goal that moves from `from` with a rate, 1/s, for some time.
    pub(crate) fn moving(from: [f64; N], rate: [f64; N], stamp: Nanos, horizon_s: f64) -> Self {
        Self { rate, horizon_s, ..Self::first(from, stamp) }
    }

    /// A goal that moves in a straight line from `from` and reaches `goal` after a given time.
    pub(crate) fn reaching(goal: [f64; N], from: &[f64; N], stamp: Nanos, after: Nanos) -> Self {
        let after_s = after.as_seconds();
        let rate = difference(&goal, from).map(|change| change / after_s);
        Self { rate, reached_s: after_s, horizon_s: after_s, ..Self::first(goal, stamp) }
    }

    pub(crate) fn next(&self, goal: [f64; N], stamp: Nanos) -> Self {
        let interval = stamp.duration_since(self.stamp);
        if interval == Nanos::ZERO || interval > MAX_EXTRAPOLATION {
            return Self::first(goal, stamp);
        }
        let interval_s = interval.as_seconds();
        let last_rate = difference(&goal, &self.goal).map(|change| change / interval_s);
        Self {
            goal,
            stamp,
            last_rate,
            rate: zip_map(&last_rate, &self.last_rate, minmod),
            reached_s: 0.0,
            horizon_s: (HORIZON_INTERVALS * interval_s).min(MAX_EXTRAPOLATION.as_seconds()),
        }
    }

    /// The extrapolated goal now and one `tick` before, on the same straight line.
    pub(crate) fn evaluate(&self, now: Nanos, tick: Nanos) -> ([f64; N], [f64; N]) {
        let age_s = now.duration_since(self.stamp).as_seconds();
        (self.at_age(age_s), self.at_age(age_s - tick.as_seconds()))
    }

    /// The extrapolated goal at a time.
    pub(crate) fn at(&self, now: Nanos) -> [f64; N] {
        self.at_age(now.duration_since(self.stamp).as_seconds())
    }

    fn at_age(&self, age_s: f64) -> [f64; N] {
        let age_s = age_s.min(self.horizon_s) - self.reached_s;
        zip_map(&self.goal, &self.rate, |goal, rate| goal + rate * age_s)
    }
}

/// Serializes arrays of generic length; serde supports fixed lengths only.
mod array {
    use serde::de::{Deserialize, Deserializer, Error};
    use serde::ser::{Serialize, Serializer};

    pub(super) fn serialize<S: Serializer, const N: usize>(
        array: &[f64; N],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        array.as_slice().serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>, const N: usize>(
        deserializer: D,
    ) -> Result<[f64; N], D::Error> {
        let values = Vec::<f64>::deserialize(deserializer)?;
        let found = values.len();
        values
            .try_into()
            .map_err(|_| D::Error::custom(format_args!("{found} numbers instead of {N}")))
    }
}

/// The lesser of two rates, or 0 if they have different signs.
fn minmod(a: f64, b: f64) -> f64 {
    if a * b <= 0.0 { 0.0 } else { a.abs().min(b.abs()).copysign(a) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TICK: Nanos = Nanos::from_millis(1);

    fn ms(milliseconds: u64) -> Nanos {
        Nanos::from_millis(1000 + milliseconds)
    }

    fn stream(goals: &[f64], interval_ms: u64) -> GoalExtrapolation<1> {
        let mut goal = GoalExtrapolation::first([goals[0]], ms(0));
        for (k, next) in (1..).zip(&goals[1..]) {
            goal = goal.next([*next], ms(k * interval_ms));
        }
        goal
    }

    /// Goals of a stream, its interval, the time of evaluation, and the expected goal.
    #[test]
    fn steady_motion_is_extrapolated_for_a_bounded_time() {
        for (goals, interval_ms, at_ms, expected) in [
            (&[0.0, 1.0, 2.0], 5, 13, 2.6),
            // Two intervals after the last command.
            (&[0.0, 1.0, 2.0], 5, 500, 4.0),
            // 20 ms at most.
            (&[0.0, 1.5, 3.0], 15, 500, 5.0),
            (&[0.0, 1.0, 2.0], 20, 500, 3.0),
            // Slow streams are not extrapolated.
            (&[0.0, 1.0, 2.0], 25, 60, 2.0),
            // Equal stamps do not divide by zero.
            (&[0.0, 1.0, 2.0], 0, 1, 2.0),
        ] {
            let ([now], [before]) = stream(goals, interval_ms).evaluate(ms(at_ms), TICK);
            assert!((now - expected).abs() < 1e-9, "{now} instead of {expected}");
            let increment = if at_ms == 13 { 0.2 } else { 0.0 };
            assert!((now - before - increment).abs() < 1e-9, "{now} {before}");
        }
    }

    #[test]
    fn steps_reversals_pauses_and_first_commands_are_not_extrapolated() {
        for goals in
            [&[7.0][..], &[0.0, 5.0], &[0.0, 0.0, 5.0], &[0.0, 1.0, 0.5], &[0.0, 1.0, 2.0, 2.0]]
        {
            let last = *goals.last().unwrap();
            let found = stream(goals, 5).evaluate(ms(5 * goals.len() as u64), TICK);
            assert_eq!(found, ([last], [last]), "{goals:?}");
        }
    }

    #[test]
    fn rate_is_integrated_and_interpolated_goal_arrives_on_time() {
        let moving = GoalExtrapolation::moving([1.0], [10.0], ms(0), 0.05);
        let reaching = GoalExtrapolation::reaching([2.0], &[1.0], ms(0), Nanos::from_millis(100));
        for (at_ms, [moved, reached]) in [
            (0, [1.0, 1.0]),
            (20, [1.2, 1.2]),
            (50, [1.5, 1.5]),
            (80, [1.5, 1.8]),
            (900, [1.5, 2.0]),
        ] {
            let found = [moving.at(ms(at_ms))[0], reaching.at(ms(at_ms))[0]];
            assert!(
                (found[0] - moved).abs() < 1e-9 && (found[1] - reached).abs() < 1e-9,
                "{found:?}"
            );
        }
        // A later stream of angles must not be extrapolated from this motion, which the client did
        // not command.
        let next = reaching.next([2.1], ms(10));
        assert_eq!(next.at(ms(15)), [2.1]);
    }

    proptest! {
        #[test]
        fn goal_leads_by_at_most_two_steps(
            steps in prop::collection::vec((-50.0..50.0_f64, 0..40_u64), 1..10), age in 0..2000_u64
        ) {
            let (mut goal, mut stamp) = (0.0, 0);
            let mut extrapolation = GoalExtrapolation::first([goal], ms(stamp));
            let mut last_step = 0.0_f64;
            for (step, interval) in steps {
                (goal, stamp, last_step) = (goal + step, stamp + interval, step);
                extrapolation = extrapolation.next([goal], ms(stamp));
            }
            let ([now], _) = extrapolation.evaluate(ms(stamp + age), TICK);
            let ahead = (now - goal) * last_step.signum();
            prop_assert!(ahead >= 0.0 && ahead <= 2.0 * last_step.abs() + 1e-9, "{ahead}");
        }
    }
}
