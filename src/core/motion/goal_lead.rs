//! Goal lead: the goal a little ahead of time, against the known delay of the chain.
//!
//! A setpoint waits for the tick and for its turn on the line, and the motor follows it with a lag:
//! some 10 ms at 115200 baud. At 20 deg/s the tip is 0.2 deg late. So the goal is led along its
//! velocity by `compensation.lead_ms`. The velocity is filtered, because a lead multiplies its
//! noise. A goal at rest is not moved; one that stops at once is overshot by its velocity times the
//! lead, for about [`VELOCITY_FILTER_S`], and is at rest a few of these later.
//!
//! The joint limits come after it, so what it adds is limited as any goal is.

use serde::{Deserialize, Serialize};

use crate::core::motion::GoalStep;
use crate::core::vector::{difference, zip_map};
use crate::units::{Nanos, OutputVec};

/// Two stairs of a stream at 200 Hz. Hands accelerate with some 100 deg/s^2: in this time by
/// 1 deg/s, which a lead of 10 ms makes 0.01 deg.
const VELOCITY_FILTER_S: f64 = 0.01;

/// A lead that is less than this ends with the motion of the goal, rad (m): 0.0006 deg.
const MIN_LEAD: f64 = 1e-5;

/// The lead and the velocity of the goal that is followed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct GoalLead {
    /// Ticks; 0: off.
    ticks: f64,
    /// Fraction of the way to the present velocity that the filtered one goes per tick.
    gain: f64,
    /// Filtered, rad (m) per tick.
    velocity: OutputVec,
}

impl GoalLead {
    pub(super) fn new(lead_ms: f64, tick: Nanos) -> Self {
        let tick_s = tick.as_seconds();
        let gain = tick_s / (tick_s + VELOCITY_FILTER_S);
        Self { ticks: 1e-3 * lead_ms / tick_s, gain, velocity: OutputVec::default() }
    }

    pub(super) fn is_off(&self) -> bool {
        self.ticks <= 0.0
    }

    /// How far the goal of this tick was led, rad (m).
    pub(super) fn amount(&self) -> OutputVec {
        self.velocity.map(|velocity| self.ticks * velocity)
    }

    /// The next goal is the first of a stream.
    pub(super) fn restart(&mut self) {
        self.velocity = OutputVec::default();
    }

    /// Leads the goal of this tick. The way from `before` to `now` is its motion.
    pub(super) fn lead(&mut self, goal: GoalStep) -> GoalStep {
        let motion = difference(&goal.now, &goal.before);
        let before = self.velocity;
        let gain = self.gain;
        self.velocity = zip_map(&before, &motion, |slow, now| slow + gain * (now - slow));
        let is_small = |velocity: &f64| (self.ticks * velocity).abs() < MIN_LEAD;
        if motion == OutputVec::default() && self.velocity.iter().all(is_small) {
            self.velocity = OutputVec::default();
        }
        let ahead = |goal: &OutputVec, velocity: &OutputVec| {
            zip_map(goal, velocity, |goal, velocity| goal + self.ticks * velocity)
        };
        GoalStep { now: ahead(&goal.now, &self.velocity), before: ahead(&goal.before, &before) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Led goals of a motion, one per tick of 1 ms.
    fn led(lead_ms: f64, goal: impl Fn(f64) -> f64) -> Vec<GoalStep> {
        let mut lead = GoalLead::new(lead_ms, Nanos::from_millis(1));
        let at = |tick: i32| [goal(1e-3 * f64::from(tick)), 0.0, 0.0];
        (1..=1000).map(|tick| lead.lead(GoalStep { now: at(tick), before: at(tick - 1) })).collect()
    }

    #[test]
    fn steady_goal_is_led_and_resting_goal_is_not() {
        let ramp = led(8.0, |t| 0.2 * t);
        assert!((ramp[500].now[0] - 0.2 * (0.501 + 0.008)).abs() < 1e-12);
        assert!((ramp[500].now[0] - ramp[500].before[0] - 0.2e-3).abs() < 1e-12);
        assert!(led(8.0, |_| 0.3).iter().all(|step| step.now == [0.3, 0.0, 0.0]));
    }

    #[test]
    fn abrupt_stop_overshoots_by_at_most_the_lead() {
        let stop = led(10.0, |t| 0.2 * t.min(0.5));
        let over = |tick: usize| stop[tick].now[0] - 0.1;
        let highest = (400..1000).map(over).fold(0.0, f64::max);
        assert!(highest <= 0.2 * 0.01 + 1e-12, "{highest}");
        assert!(over(499 + 20) < 0.2 * highest, "{} of {highest}", over(519));
        assert!((over(499 + 60)).abs() < 1e-15, "at rest");
    }
}
