//! Joint filter: what a goal in joint space passes through before it is inverted.
//!
//! First the [`TremorFilter`], then the [`GoalLead`], then the [`JointLimits`], each only if it is
//! configured. A stop does not pass through the filter: it must be short, so only the limits of the
//! motors apply.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::motion::GoalStep;
use crate::core::motion::joint_limits::JointLimits;
use crate::core::vector::{difference, zip_map};
use crate::units::{Nanos, OutputVec};

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct JointFilter {
    tremor_filter: TremorFilter,
    lead: GoalLead,
    limits: JointLimits,
    last: Option<FilterOutputs>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct FilterOutputs {
    tremor_filter: OutputVec,
    limits: OutputVec,
}

impl JointFilter {
    /// `has_angles`: the outputs of the model are angles.
    pub(crate) fn new(config: &Config, tick: Nanos, has_angles: bool) -> Self {
        Self {
            tremor_filter: TremorFilter::new(config.command.tremor_filter_hz, tick),
            lead: GoalLead::new(config.compensation.lead_ms, tick),
            limits: JointLimits::new(&config.joint_limits, tick, has_angles),
            last: None,
        }
    }

    /// No goal is followed: the next goal starts the filter again.
    pub(crate) fn reset(&mut self) {
        self.last = None;
    }

    /// How far the goal of this tick was led on purpose, rad (m).
    pub(crate) fn lead(&self) -> OutputVec {
        self.lead.amount()
    }

    /// Filters the goal of this tick. `start`: the setpoint, from which the filter starts.
    pub(crate) fn filter(&mut self, goal: GoalStep, start: OutputVec) -> GoalStep {
        if self.tremor_filter.is_off() && self.lead.is_off() && self.limits.is_off() {
            return goal;
        }
        let last = self.last.unwrap_or_else(|| {
            self.lead.restart();
            self.limits.restart(&start);
            FilterOutputs { tremor_filter: start, limits: start }
        });
        let smooth = self.tremor_filter.filter(&last.tremor_filter, &goal.now);
        let smooth_before =
            if self.tremor_filter.is_off() { goal.before } else { last.tremor_filter };
        let led = self.lead.lead(GoalStep { now: smooth, before: smooth_before });
        let limited = self.limits.limit(&led.now, &led.before);
        self.last = Some(FilterOutputs { tremor_filter: smooth, limits: limited });
        let before = if self.limits.is_off() { led.before } else { last.limits };
        GoalStep { now: limited, before }
    }
}

/// Tremor filter: a first-order low-pass filter on the goal of servo commands. The caller keeps its
/// output.
///
/// It delays slow motion by its time constant, `1 / (2 pi f)`: 53 ms at 3 Hz. Hand tremor has 8 to
/// 12 Hz (C. N. Riviere et al. 1998); a 3 Hz filter passes a third of that.
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

    pub(super) fn filter(&self, last: &OutputVec, goal: &OutputVec) -> OutputVec {
        if self.is_off() {
            *goal
        } else {
            zip_map(last, goal, |last, goal| last + self.gain * (goal - last))
        }
    }
}

/// Two stairs of a stream at 200 Hz. Hands accelerate with some 100 deg/s^2: in this time by
/// 1 deg/s, which a lead of 10 ms makes 0.01 deg.
const VELOCITY_FILTER_S: f64 = 0.01;

/// A lead that is less than this ends with the motion of the goal, rad (m): 0.0006 deg.
const MIN_LEAD: f64 = 1e-5;

/// Goal lead: the goal a little ahead of time, against the known delay of the chain.
///
/// A setpoint waits for the tick and for its turn on the line, and the motor follows it with a lag:
/// some 10 ms at 115200 baud. At 20 deg/s the tip is 0.2 deg late. So the goal is led along its
/// velocity by `compensation.lead_ms`. The velocity is filtered, because a lead multiplies its
/// noise. A goal at rest is not moved; one that stops at once is overshot by its velocity times the
/// lead, for about [`VELOCITY_FILTER_S`], and is at rest a few of these later.
///
/// The joint limits come after it, so what it adds is limited as any goal is.
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
    fn amount(&self) -> OutputVec {
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
    use crate::config::JointLimitConfig;

    fn filter(joint_limits: JointLimitConfig, lead_ms: f64) -> JointFilter {
        let text = include_str!("../../../config/emulator.toml");
        let mut config = Config::parse(text, "emulator.toml".as_ref()).unwrap();
        config.joint_limits = joint_limits;
        config.compensation.lead_ms = lead_ms;
        JointFilter::new(&config, Nanos::from_millis(1), true)
    }

    #[test]
    fn without_limits_and_filter_a_goal_passes_unchanged() {
        let step = GoalStep { now: [0.3, 0.2, 0.1], before: [0.2, 0.1, 0.0] };
        let mut filter = filter(JointLimitConfig::OFF, 0.0);
        assert_eq!(filter.filter(step, [9.0; 3]), step);
    }

    #[test]
    fn a_new_stream_starts_at_the_setpoint() {
        let limits = JointLimitConfig {
            velocity_deg_s: Some(10.0),
            acceleration_deg_s2: Some(100.0),
            ..JointLimitConfig::OFF
        };
        let mut filter = filter(limits, 0.0);
        let goal = GoalStep { now: [0.1; 3], before: [0.1; 3] };
        for _ in 0..2 {
            let first = filter.filter(goal, [0.05; 3]);
            assert!((first.now[0] - 0.05).abs() < 0.001 && first.before == [0.05; 3]);
            filter.reset();
        }
    }

    #[test]
    fn lead_needs_no_limits_and_resets_with_stream() {
        let mut filter = filter(JointLimitConfig::OFF, 10.0);
        let at = |tick: i32| [1e-4 * f64::from(tick), 0.0, 0.0];
        for tick in 1..=500 {
            let led = filter.filter(GoalStep { now: at(tick), before: at(tick - 1) }, at(0));
            assert!(tick < 400 || (led.now[0] - at(tick + 10)[0]).abs() < 1e-9, "{led:?}");
        }
        filter.reset();
        let still = GoalStep { now: at(500), before: at(500) };
        assert_eq!(filter.filter(still, at(500)), still);
    }

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
