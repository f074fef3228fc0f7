//! Joint filter: what a goal in joint space passes through before it is inverted.
//!
//! First the [`TremorFilter`], then the [`GoalLead`], then the [`JointLimits`], each only if it is
//! configured. A stop does not pass through the filter: it must be short, so only the limits of the
//! motors apply.

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::motion::GoalStep;
use crate::core::motion::goal_lead::GoalLead;
use crate::core::motion::joint_limits::JointLimits;
use crate::core::motion::tremor_filter::TremorFilter;
use crate::units::{Nanos, OutputVec};

/// The filters and their state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct JointFilter {
    tremor_filter: TremorFilter,
    lead: GoalLead,
    limits: JointLimits,
    last: Option<FilterOutputs>,
}

/// Outputs of the last tick.
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
}
