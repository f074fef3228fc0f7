//! Control of one axis: its setpoint, its monitors, and the requests to its drive.

use serde::{Deserialize, Serialize};

use crate::config::{AxisConfig, Config};
use crate::core::drive_status::{DriveStatus, position_age};
use crate::core::events::{CycleEventKind, EventList};
use crate::core::faults::{FollowingErrorLimit, OverCurrentMonitor, written_after};
use crate::core::motion::setpoint_source::SetpointSource;
use crate::core::motion::velocity_limit::{JerkLimiter, MotorLimits, MotorTarget, VelocityLimiter};
use crate::drive::{AxisFeedback, AxisPhase, AxisRequest, Demand};
use crate::robot::{Measurement, Quantity};
use crate::units::{Counts, Nanos};

/// Rounding error of a long sum, counts.
const ROUNDING: f64 = 1e-6;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct AxisControl {
    lowest: Counts,
    highest: Counts,
    following_error: FollowingErrorLimit,
    limiter: VelocityLimiter,
    jerk_limiter: JerkLimiter,
    source: SetpointSource,
    over_current: OverCurrentMonitor,
    fault_resets: u32,
    homings: u32,
    /// The zero is valid only if it comes from this homing or a later one.
    valid_homing: u32,
    feedback: AxisFeedback,
    /// Since when the drive has another setpoint than this one, while it follows.
    unwritten: Option<Nanos>,
}

impl AxisControl {
    /// An axis whose drive has not reported yet.
    pub(crate) fn new(axis: &AxisConfig, config: &Config) -> Self {
        let (lowest, highest) = (axis.position_min_counts, axis.position_max_counts);
        let period = config.control.period();
        let limits = MotorLimits {
            velocity: config.limits.velocity_counts_s,
            acceleration: config.limits.acceleration_counts_s2,
            deceleration: config.limits.stop_deceleration_counts_s2,
            lowest: lowest.as_f64(),
            highest: highest.as_f64(),
        };
        Self {
            lowest,
            highest,
            following_error: FollowingErrorLimit::new(config.limits.following_error_counts),
            limiter: VelocityLimiter::new(&limits, period),
            jerk_limiter: JerkLimiter::new(config.limits.window_ticks(period).unwrap_or(1)),
            source: SetpointSource::Tracking,
            over_current: OverCurrentMonitor::new(
                config.limits.over_current_ma,
                config.over_current_time(),
            ),
            fault_resets: 0,
            homings: 0,
            valid_homing: 0,
            feedback: AxisFeedback::default(),
            unwritten: None,
        }
    }

    /// Takes the feedback of this tick. Every change of phase is an event, and so is the error code
    /// of a drive at fault, which is read after its phase has changed.
    pub(crate) fn update_feedback(
        &mut self,
        motor: u8,
        feedback: &AxisFeedback,
        now: Nanos,
        events: &mut EventList,
    ) {
        let (from, to, error_code) = (self.feedback.phase, feedback.phase, feedback.error_code);
        let is_explained = to == AxisPhase::Faulted && self.feedback.error_code == 0;
        if from != to {
            events.push(CycleEventKind::Axis { motor, from, to, error_code });
        } else if is_explained && error_code != 0 {
            let code = Measurement::new(Quantity::ErrorCode, f64::from(error_code), None);
            let event = CycleEventKind::Axis { motor, from, to, error_code };
            events.push_measured(event, Some(code.of_motor(motor)));
        }
        self.feedback = *feedback;
        self.unwritten = self.written().filter(|it| *it != Some(self.target())).map(|written| {
            // A written setpoint counts from then on, even while it lags.
            let last = written.and(feedback.written).map_or(Nanos::ZERO, |it| it.stamp);
            self.unwritten.unwrap_or(now).max(last)
        });
        self.over_current.update(feedback, self.source.following_since());
    }

    /// The setpoint that the drive has; `None` unless it follows.
    fn written(&self) -> Option<Option<Counts>> {
        let since = self.source.following_since()?;
        Some(written_after(&self.feedback, since).map(|written| written.target))
    }

    pub(crate) fn feedback(&self) -> &AxisFeedback {
        &self.feedback
    }

    pub(crate) fn status(&self, now: Nanos) -> DriveStatus {
        DriveStatus {
            phase: self.feedback.phase,
            age: position_age(&self.feedback, now),
            unwritten: self.unwritten.map_or(Nanos::ZERO, |since| now.duration_since(since)),
            has_following_error: self.following_error_measurement().is_some(),
            has_over_current: self.over_current.is_tripped,
        }
    }

    pub(crate) fn following_error_measurement(&self) -> Option<Measurement> {
        self.following_error.measurement(&self.feedback, self.source.following_since()?)
    }

    pub(crate) fn over_current_measurement(&self) -> Option<Measurement> {
        self.over_current.measurement(self.feedback.current_ma)
    }

    /// The nearest limit of the axis, if a position is beyond it.
    pub(crate) fn range_measurement(&self, position: Counts) -> Option<Measurement> {
        let counts = position.as_f64();
        (!self.allows(position))
            .then(|| Measurement::new(Quantity::Counts, counts, Some(self.clamp(counts))))
    }

    /// The drive has a zero, and no command has made it invalid.
    pub(crate) fn is_homed(&self) -> bool {
        self.feedback.homed && self.feedback.homings >= self.valid_homing
    }

    /// The motor is within its position limits. Outside of them a drive cannot be enabled where it
    /// is: it would clamp its target to its own limits, which is a jump.
    pub(crate) fn is_in_range(&self) -> bool {
        self.allows(self.feedback.position)
    }

    pub(crate) fn allows(&self, position: Counts) -> bool {
        (self.lowest..=self.highest).contains(&position)
    }

    pub(crate) fn clamp(&self, position: f64) -> f64 {
        position.max(self.lowest.as_f64()).min(self.highest.as_f64())
    }

    /// The setpoint does not move.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.limiter.is_at_rest() && self.jerk_limiter.is_at_rest()
    }

    /// The setpoint moves less than a count in a hundred ticks. An inverse that searches may creep
    /// towards its solution for ever.
    pub(crate) fn is_settled(&self) -> bool {
        const COUNTS_PER_TICK: f64 = 0.01;
        self.limiter.velocity().abs() < COUNTS_PER_TICK && self.jerk_limiter.is_settled()
    }

    /// Every requested homing has ended.
    pub(crate) fn is_homing_done(&self) -> bool {
        self.feedback.homings == self.homings && self.feedback.phase == AxisPhase::Disabled
    }

    /// Every requested fault reset is done, and the drive is not at fault.
    pub(crate) fn is_reset_done(&self) -> bool {
        self.feedback.fault_resets == self.fault_resets && self.feedback.phase != AxisPhase::Faulted
    }

    pub(crate) fn start_homing(&mut self) {
        self.homings = self.homings.wrapping_add(1);
    }

    /// Makes the zero invalid until a homing that is requested from now on has ended.
    pub(crate) fn invalidate_zero(&mut self) {
        self.valid_homing = self.homings.wrapping_add(1);
    }

    pub(crate) fn reset_fault(&mut self) {
        if self.feedback.phase == AxisPhase::Faulted {
            self.fault_resets = self.fault_resets.wrapping_add(1);
        }
    }

    /// Updates the source of the setpoint for this tick's demand to the drive.
    pub(crate) fn update_source(&mut self, demand: Demand, now: Nanos) {
        let before = self.source;
        self.source = before.next(demand, &self.feedback, now);
        if let Some(position) = self.source.restart_position(before, &self.feedback) {
            self.limiter.restart(position.as_f64());
            self.jerk_limiter.restart(position.as_f64());
        }
    }

    /// Moves the setpoint one tick towards a target, if the drive follows, with a share of the
    /// velocity between a stop (0) and the target (1).
    pub(crate) fn track(&mut self, target: MotorTarget, share: f64) {
        if self.source.is_following() {
            self.limiter.track_part(target, share);
            self.jerk_limiter.update(self.limiter.position());
        }
    }

    /// The velocities of the next tick in a stop and towards a target, counts per tick.
    pub(crate) fn next_velocities(&self, target: MotorTarget) -> [f64; 2] {
        [self.limiter.next_velocity(0.0), self.limiter.velocity_towards(target)]
    }

    /// Where the setpoint comes to rest when it stops from now on, counts.
    pub(crate) fn rest_position(&self) -> f64 {
        self.limiter.rest_position()
    }

    /// Ticks until then.
    pub(crate) fn ticks_to_rest(&self) -> f64 {
        self.limiter.ticks_to_rest()
    }

    /// The setpoint on the wire is within the position limits, or no further out than `before`,
    /// one tick ago, and its step and the change of its step are within the limits.
    pub(crate) fn keeps_limits(&self, before: &Self) -> bool {
        let [longest, change] = self.limiter.largest_steps().map(|most| most + ROUNDING);
        let outside = |axis: &Self| (axis.clamp(axis.setpoint()) - axis.setpoint()).abs();
        let step = self.setpoint() - before.setpoint();
        outside(self) <= outside(before) + ROUNDING
            && step.abs() <= longest
            && (step - before.increment()).abs() <= change
    }

    /// Slows the setpoint down for one tick.
    pub(crate) fn stop(&mut self) {
        self.limiter.stop();
        self.jerk_limiter.update(self.limiter.position());
    }

    /// The setpoint before rounding, counts.
    pub(crate) fn setpoint(&self) -> f64 {
        self.jerk_limiter.output
    }

    /// Change of the setpoint in this tick, counts.
    pub(crate) fn increment(&self) -> f64 {
        self.jerk_limiter.increment
    }

    /// The setpoint as sent to the drive.
    pub(crate) fn target(&self) -> Counts {
        // The setpoint stays between positions that are counts, so the conversion cannot fail.
        Counts::from_f64(self.setpoint()).unwrap_or(self.feedback.position)
    }

    /// The request to the drive. `common` gives sequence and command.
    pub(crate) fn request(&self, demand: Demand, common: &AxisRequest) -> AxisRequest {
        AxisRequest {
            demand,
            target: self.target(),
            fault_resets: self.fault_resets,
            homings: self.homings,
            zero_invalid: self.feedback.homings < self.valid_homing,
            ..*common
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An axis from -1000 to 1000 counts with 2 counts per tick, 0.04 more and 0.25 less per tick.
    fn axis() -> AxisControl {
        let text = include_str!("../../../config/emulator.toml");
        let mut config = Config::parse(text, "emulator.toml".as_ref()).unwrap();
        config.limits.velocity_counts_s = 2000.0;
        config.limits.acceleration_counts_s2 = 40_000.0;
        config.limits.stop_deceleration_counts_s2 = 250_000.0;
        let axis = &mut config.ports[0].axes[0];
        (axis.position_min_counts, axis.position_max_counts) = (Counts(-1000), Counts(1000));
        AxisControl::new(&axis.clone(), &config)
    }

    /// The gate detects violations even though the limiter never commits them.
    #[test]
    fn step_keeps_limits_or_reduces_the_violation() {
        for (at, increment, step, is_kept) in [
            (0.0, 2.0, 2.0, true),
            (0.0, -2.0, -2.0, true),
            (0.0, 2.0, 2.01, false),
            (0.0, -2.0, -2.01, false),
            (0.0, 1.0, 1.25, true),
            (0.0, 1.0, 0.75, true),
            (0.0, 1.0, 1.26, false),
            (0.0, 1.0, 0.74, false),
            (999.9, 0.1, 0.1, true),
            (999.9, 0.1, 0.101, false),
            (-999.9, -0.1, -0.101, false),
            // From further outside, where the drive was enabled, only back.
            (1005.0, 0.0, 0.0, true),
            (1005.0, 0.0, -0.1, true),
            (1005.0, 0.0, 0.1, false),
            (-1005.0, 0.0, -0.1, false),
            (-1005.0, 0.0, 0.1, true),
        ] {
            let mut before = axis();
            before.jerk_limiter.restart(at - increment);
            before.jerk_limiter.update(at);
            let mut after = before;
            after.jerk_limiter.update(at + step);
            assert_eq!(after.keeps_limits(&before), is_kept, "{step} after {increment} at {at}");
        }
    }

    #[test]
    fn it_rests_when_the_average_over_the_last_ticks_rests() {
        let mut axis = axis();
        axis.jerk_limiter = JerkLimiter::new(2);
        axis.jerk_limiter.update(2.0);
        assert!(axis.limiter.is_at_rest() && !axis.is_at_rest() && !axis.is_settled());
        (0..2).for_each(|_| axis.jerk_limiter.update(2.0));
        assert!(axis.is_at_rest() && axis.is_settled());
    }

    #[test]
    fn homing_and_reset_wait_for_the_drive_counters() {
        use AxisPhase::{Disabled, Faulted, Homing};
        for (phase, done, is_homed, is_reset) in [
            (Disabled, 1, true, true),
            (Disabled, 0, false, false),
            (Homing, 1, false, true),
            (Faulted, 1, false, false),
        ] {
            let mut axis = axis();
            axis.feedback.phase = Faulted;
            axis.reset_fault();
            axis.start_homing();
            (axis.feedback.homings, axis.feedback.fault_resets) = (done, done);
            axis.feedback.phase = phase;
            let found = (axis.is_homing_done(), axis.is_reset_done());
            assert_eq!(found, (is_homed, is_reset), "{phase:?} {done}");
        }
    }
}
