//! The goal between two commands.
//!
//! Commands come as a staircase: at 200 Hz a new goal every five ticks. Taken as it stands, the
//! set-point would stop on every stair and be half a stair late on average, and a limiter that has
//! to be able to stop on a stair stays behind even more. Interpolating makes a smooth path one
//! whole stair late; at 12 deg/s a stair of 5 ms is 0.06 deg. So the goal is **extrapolated**: it
//! moves on as it moved between the last commands. In steady motion that costs no time at all.
//!
//! The price is that the goal may run ahead of what was asked. It is bounded:
//!
//! - per output, the lesser of the last two rates of change counts, and none if they disagree in
//!   sign (the minmod of the slope limiters of fluid dynamics; P. L. Roe 1986). A step, a first
//!   command or a reversal is not extrapolated, and a client that stays where it is stops the goal
//!   with its first command;
//! - it goes on for at most [`HORIZON_INTERVALS`] intervals and [`LONGEST`], so a client that dies
//!   leaves the goal at rest a few stairs on, long before its deadline;
//! - streams slower than [`LONGEST`] are not extrapolated.

use serde::{Deserialize, Serialize};

use crate::units::Nanos;

/// Late commands are normal on a desktop system; one interval of grace keeps the set-point from
/// stopping for each.
const HORIZON_INTERVALS: f64 = 2.0;

/// 20 ms. A hand that accelerates with 10,000 counts/s^2 departs from the straight line by 2 counts
/// in that time.
const LONGEST: Nanos = Nanos::from_millis(20);

/// A goal of `N` values and where it is heading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Trend<const N: usize> {
    /// As asked.
    #[serde(with = "array")]
    goal: [f64; N],
    /// When it was asked.
    stamp: Nanos,
    /// Change since the command before, per second; 0 if that was too long ago.
    #[serde(with = "array")]
    last_rate: [f64; N],
    /// The rate to go on with, per second.
    #[serde(with = "array")]
    rate: [f64; N],
    /// How long to go on, seconds.
    horizon_s: f64,
}

impl<const N: usize> Trend<N> {
    /// The first goal of a stream.
    pub fn first(goal: [f64; N], stamp: Nanos) -> Self {
        Self {
            goal,
            stamp,
            last_rate: [0.0; N],
            rate: [0.0; N],
            horizon_s: 0.0,
        }
    }

    /// The next goal of the same stream.
    pub fn next(&self, goal: [f64; N], stamp: Nanos) -> Self {
        let interval = stamp.since(self.stamp);
        if interval == Nanos::ZERO || interval > LONGEST {
            return Self::first(goal, stamp);
        }
        let interval_s = interval.as_seconds();
        let mut last_rate = [0.0; N];
        for ((rate, goal), before) in last_rate.iter_mut().zip(goal).zip(self.goal) {
            *rate = (goal - before) / interval_s;
        }
        let mut rate = last_rate;
        rate.iter_mut()
            .zip(self.last_rate)
            .for_each(|(rate, before)| *rate = minmod(*rate, before));
        let horizon_s = (HORIZON_INTERVALS * interval_s).min(LONGEST.as_seconds());
        Self {
            goal,
            stamp,
            last_rate,
            rate,
            horizon_s,
        }
    }

    /// As asked by the last command.
    pub fn goal(&self) -> &[f64; N] {
        &self.goal
    }

    /// Where the goal is at an instant, and where it was one `tick` before, on the same straight
    /// line.
    pub fn at(&self, now: Nanos, tick: Nanos) -> ([f64; N], [f64; N]) {
        let (age_s, tick_s) = (now.since(self.stamp).as_seconds(), tick.as_seconds());
        (self.after(age_s), self.after(age_s - tick_s))
    }

    fn after(&self, age_s: f64) -> [f64; N] {
        let age_s = age_s.min(self.horizon_s);
        let mut place = self.goal;
        place
            .iter_mut()
            .zip(self.rate)
            .for_each(|(place, rate)| *place += rate * age_s);
        place
    }
}

/// Arrays of a length that is a parameter, as a sequence of so many numbers; serde knows fixed
/// lengths only.
mod array {
    use serde::de::{Deserialize, Deserializer, Error};
    use serde::ser::{Serialize, Serializer};

    pub fn serialize<S: Serializer, const N: usize>(
        array: &[f64; N],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        array.as_slice().serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>, const N: usize>(
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
    if a * b <= 0.0 {
        0.0
    } else {
        a.abs().min(b.abs()).copysign(a)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TICK: Nanos = Nanos::from_millis(1);

    fn ms(milliseconds: u64) -> Nanos {
        Nanos::from_millis(1000 + milliseconds)
    }

    fn stream(goals: &[f64], interval_ms: u64) -> Trend<1> {
        let mut trend = Trend::first([goals[0]], ms(0));
        for (k, goal) in (1..).zip(&goals[1..]) {
            trend = trend.next([*goal], ms(k * interval_ms));
        }
        trend
    }

    #[test]
    fn a_steady_motion_goes_on_between_the_commands() {
        let trend = stream(&[0.0, 1.0, 2.0], 5);
        let ([now], [before]) = trend.at(ms(13), TICK);
        assert!(
            (now - 2.6).abs() < 1e-9 && (before - 2.4).abs() < 1e-9,
            "{now} {before}"
        );
    }

    #[test]
    fn it_ends_two_intervals_after_the_last_command() {
        let trend = stream(&[0.0, 1.0, 2.0], 5);
        let ([now], [before]) = trend.at(ms(500), TICK);
        assert!((now - 4.0).abs() < 1e-9 && now == before, "{now} {before}");
    }

    #[test]
    fn it_ends_after_20_ms_at_most() {
        let trend = stream(&[0.0, 1.5, 3.0], 15);
        let ([now], _) = trend.at(ms(500), TICK);
        assert!((now - 5.0).abs() < 1e-9, "{now}");
    }

    #[test]
    fn steps_reversals_pauses_and_first_commands_do_not_go_on() {
        for goals in [
            &[7.0][..],
            &[0.0, 5.0],
            &[0.0, 0.0, 5.0],
            &[0.0, 1.0, 0.5],
            &[0.0, 1.0, 2.0, 2.0],
        ] {
            let trend = stream(goals, 5);
            let last = *goals.last().unwrap();
            assert_eq!(
                trend.at(ms(5 * goals.len() as u64), TICK),
                ([last], [last]),
                "{goals:?}"
            );
        }
    }

    #[test]
    fn a_slow_stream_does_not_go_on() {
        let trend = stream(&[0.0, 1.0, 2.0], 25);
        assert_eq!(trend.at(ms(60), TICK), ([2.0], [2.0]));
    }

    #[test]
    fn two_commands_with_one_stamp_do_not_divide_by_zero() {
        let trend = stream(&[0.0, 1.0, 2.0], 0);
        assert_eq!(trend.at(ms(1), TICK), ([2.0], [2.0]));
    }

    proptest! {
        #[test]
        fn the_goal_never_runs_ahead_by_more_than_twice_the_last_step(
            steps in prop::collection::vec((-50.0..50.0_f64, 0..40_u64), 1..10), age in 0..2000_u64
        ) {
            let (mut goal, mut stamp) = (0.0, 0);
            let mut trend = Trend::first([goal], ms(stamp));
            let mut last_step = 0.0_f64;
            for (step, interval) in steps {
                (goal, stamp, last_step) = (goal + step, stamp + interval, step);
                trend = trend.next([goal], ms(stamp));
            }
            let ([now], _) = trend.at(ms(stamp + age), TICK);
            let ahead = (now - goal) * last_step.signum();
            prop_assert!(ahead >= 0.0 && ahead <= 2.0 * last_step.abs() + 1e-9, "{ahead} {last_step}");
        }
    }
}
