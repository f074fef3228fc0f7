//! Joint limits: position, velocity, acceleration and jerk of the angles.
//!
//! One [`VelocityLimiter`] per output: a goal within the limits is followed without lag. Then a
//! [`JerkLimiter`], which lags by half its window.

use serde::{Deserialize, Serialize};

use crate::config::JointLimitConfig;
use crate::core::motion::velocity_limit::{JerkLimiter, MotorLimits, MotorTarget, VelocityLimiter};
use crate::core::vector::{largest_difference, zip_map};
use crate::units::{MAX_OUTPUTS, Nanos, OutputVec};

/// Far beyond any angle, rad.
const NO_LIMIT: f64 = 1e6;

/// Longest time of a line to carry a setpoint, ticks, including those that are averaged around it.
pub(super) const MAX_LINE_TICKS: usize = 32;
/// Number of ticks before and after, over which the pose velocity is averaged: drives take whole
/// counts.
const AROUND: usize = 2;

/// A step may be longer than its limit by this factor, so that a goal at the limit is not slowed
/// down by what the inverse leaves; and by this, rad.
const STEP_MARGIN: f64 = 1.01;
const STEP_TOLERANCE: f64 = 5e-7;

/// The limits themselves, per tick. Without one: far beyond any angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct JointBounds {
    /// rad.
    lowest: OutputVec,
    highest: OutputVec,
    pub has_positions: bool,
    /// Largest step, and its largest growth, rad.
    velocity: f64,
    growth: f64,
    /// The time that a line takes to carry a setpoint, ticks.
    line: usize,
}

impl JointBounds {
    /// `line`: the time that the slowest line takes to carry a setpoint. `None`: off.
    pub(crate) fn new(
        config: &JointLimitConfig,
        tick: Nanos,
        line: Nanos,
        has_angles: bool,
    ) -> Option<Self> {
        let tick_s = tick.as_seconds();
        let of = |output| limits(config, output);
        let line = line.0.div_ceil(tick.0.max(1)) as usize;
        (has_angles && config.is_any()).then(|| Self {
            lowest: std::array::from_fn(|output| of(output).lowest),
            highest: std::array::from_fn(|output| of(output).highest),
            has_positions: config.position_min_deg.is_some() || config.position_max_deg.is_some(),
            velocity: of(0).velocity * tick_s,
            growth: of(0).acceleration * tick_s * tick_s,
            line: line.clamp(1, MAX_LINE_TICKS - AROUND),
        })
    }

    pub(crate) fn clamp(&self, pose: &OutputVec) -> OutputVec {
        zip_map(&zip_map(pose, &self.lowest, f64::max), &self.highest, f64::min)
    }

    /// How far a pose is beyond its position limits, rad; not below 0.
    pub(crate) fn excess(&self, pose: &OutputVec) -> f64 {
        largest_difference(pose, &self.clamp(pose))
    }

    /// The largest step of a goal after a step `last`, output by output. What slows down is not
    /// limited: a stop is short. `margin`: a factor on all limits.
    pub(crate) fn largest_goal_step(
        &self,
        step: &OutputVec,
        last: &OutputVec,
        margin: f64,
    ) -> OutputVec {
        zip_map(step, last, |step, last| {
            let speed = if step * last > 0.0 { last.abs() } else { 0.0 };
            (speed + margin * self.growth).min(margin * self.velocity)
        })
    }

    /// The longest step of the pose at the setpoints after others, newest first, output by output:
    /// over the time of a line its velocity changes by no more than the acceleration allows.
    pub(crate) fn longest_step(
        &self,
        step: &OutputVec,
        last: &[OutputVec; MAX_LINE_TICKS],
    ) -> OutputVec {
        let around = AROUND.min(self.line - 1);
        let then = last.get(self.line - 1 - around..self.line + around).unwrap_or_default();
        let mut longest = OutputVec::default();
        for (output, (longest, step)) in longest.iter_mut().zip(step).enumerate() {
            let along = |step_before: &OutputVec| step_before[output] * step.signum();
            let then = then.iter().map(along).sum::<f64>() / then.len() as f64;
            let most = then + STEP_MARGIN * self.growth * self.line as f64 + STEP_TOLERANCE;
            let most = most.max(along(&last[0])).max(0.0);
            *longest = most.min(STEP_MARGIN * self.velocity + STEP_TOLERANCE);
        }
        longest
    }

    /// The longest way of the pose after a step until the motors are at rest some ticks later: as
    /// long as that of a tip that slows down evenly, or no longer than one step may be.
    pub(crate) fn longest_way(
        &self,
        way: &OutputVec,
        step: &OutputVec,
        last: &[OutputVec; MAX_LINE_TICKS],
        ticks: f64,
    ) -> OutputVec {
        let longest = self.longest_step(way, last);
        let evenly = zip_map(way, step, |way, step| {
            let along = (step * way.signum()).max(0.0);
            0.5 * (ticks + 1.0) * STEP_MARGIN * along + STEP_TOLERANCE
        });
        zip_map(&longest, &evenly, f64::max)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct JointLimits {
    /// `None`: off.
    limiters: Option<[VelocityLimiter; MAX_OUTPUTS]>,
    jerk_limiters: [JerkLimiter; MAX_OUTPUTS],
}

impl JointLimits {
    /// `has_angles`: the outputs are angles. Limits in degrees mean nothing for other outputs.
    pub(super) fn new(config: &JointLimitConfig, tick: Nanos, has_angles: bool) -> Self {
        let is_on = has_angles && config.is_any();
        let limiters = is_on.then(|| {
            std::array::from_fn(|output| VelocityLimiter::new(&limits(config, output), tick))
        });
        let window = config.window_ticks(tick).filter(|_| is_on).unwrap_or(1);
        Self { limiters, jerk_limiters: [JerkLimiter::new(window); MAX_OUTPUTS] }
    }

    pub(super) fn is_off(&self) -> bool {
        self.limiters.is_none()
    }

    pub(super) fn restart(&mut self, start: &OutputVec) {
        for (limiter, start) in self.limiters.iter_mut().flatten().zip(start) {
            limiter.restart(*start);
        }
        for (limiter, start) in self.jerk_limiters.iter_mut().zip(start) {
            limiter.restart(*start);
        }
    }

    /// Moves one tick towards a goal, which was at `before` one tick ago.
    pub(super) fn limit(&mut self, goal: &OutputVec, before: &OutputVec) -> OutputVec {
        let mut limited = *goal;
        let limiters = self.limiters.iter_mut().flatten().zip(&mut self.jerk_limiters);
        for (((limiter, jerk_limiter), value), before) in limiters.zip(&mut limited).zip(before) {
            limiter.track(MotorTarget { position: *value, increment: *value - before });
            jerk_limiter.update(limiter.position());
            *value = jerk_limiter.output;
        }
        limited
    }
}

fn limits(config: &JointLimitConfig, output: usize) -> MotorLimits {
    let position = |limits: &Option<Vec<f64>>, default: f64| {
        let limit = limits.as_ref().and_then(|limits| limits.get(output));
        limit.map_or(default, |degrees| degrees.to_radians())
    };
    let or_none = |limit: Option<f64>| limit.map_or(NO_LIMIT, f64::to_radians);
    let acceleration = or_none(config.acceleration_deg_s2);
    MotorLimits {
        velocity: or_none(config.velocity_deg_s),
        acceleration,
        deceleration: acceleration,
        lowest: position(&config.position_min_deg, -NO_LIMIT),
        highest: position(&config.position_max_deg, NO_LIMIT),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: Nanos = Nanos::from_millis(1);

    fn largest(values: &[f64]) -> f64 {
        values.iter().fold(0.0, |largest, value| largest.max(value.abs()))
    }

    fn derivative(values: &[f64]) -> Vec<f64> {
        let pairs = values.windows(2);
        pairs.map(|pair| (pair[1] - pair[0]) * 1e3).collect()
    }

    #[test]
    fn velocity_acceleration_and_jerk_stay_within_their_limits() {
        let config = JointLimitConfig {
            velocity_deg_s: Some(20.0),
            acceleration_deg_s2: Some(400.0),
            jerk_deg_s3: Some(40_000.0),
            position_max_deg: Some(vec![4.0, 30.0]),
            ..JointLimitConfig::OFF
        };
        let mut joint_limits = JointLimits::new(&config, TICK, true);
        joint_limits.restart(&[0.0; 3]);
        // A step to beyond the position limit, and one back.
        let goal = |k: u32| [if k < 600 { 8.0_f64 } else { -3.0 }.to_radians(), 0.0, 0.0];
        let out: Vec<f64> = (1..=1500)
            .map(|k| joint_limits.limit(&goal(k), &goal(k - 1))[0].to_degrees())
            .collect();
        assert!((out[598] - 4.0).abs() < 1e-9, "{}", out[598]);
        assert!((out[1499] + 3.0).abs() < 1e-9, "{}", out[1499]);
        let velocity = derivative(&out);
        let acceleration = derivative(&velocity);
        let jerk = derivative(&acceleration);
        assert!(largest(&velocity) <= 20.0 + 1e-6, "{}", largest(&velocity));
        assert!(largest(&acceleration) <= 400.0 + 1e-3, "{}", largest(&acceleration));
        assert!(largest(&jerk) <= 40_000.0 + 1.0, "{}", largest(&jerk));
    }

    #[test]
    fn limits_on_angles_are_off_for_other_outputs() {
        let config = JointLimitConfig { velocity_deg_s: Some(20.0), ..JointLimitConfig::OFF };
        assert!(JointLimits::new(&config, TICK, false).is_off());
        assert!(JointLimits::new(&JointLimitConfig::OFF, TICK, true).is_off());
    }

    #[test]
    fn restart_begins_at_rest() {
        let config = JointLimitConfig {
            velocity_deg_s: Some(20.0),
            acceleration_deg_s2: Some(400.0),
            jerk_deg_s3: Some(40_000.0),
            ..JointLimitConfig::OFF
        };
        let mut joint_limits = JointLimits::new(&config, TICK, true);
        let start = [0.3, -0.2, 0.0];
        joint_limits.restart(&start);
        assert_eq!(joint_limits.limit(&start, &start), start);
    }

    #[test]
    fn lowest_and_highest_angles_are_as_configured() {
        let config = JointLimitConfig {
            position_min_deg: Some(vec![-4.0, -30.0]),
            position_max_deg: Some(vec![6.0, 20.0]),
            ..JointLimitConfig::OFF
        };
        let of = |output| {
            let limits = limits(&config, output);
            [limits.lowest, limits.highest]
        };
        assert_eq!(of(0), [-4.0, 6.0].map(f64::to_radians));
        assert_eq!(of(1), [-30.0, 20.0].map(f64::to_radians));
        assert_eq!(of(2), [-NO_LIMIT, NO_LIMIT]);
    }
}
