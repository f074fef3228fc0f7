//! All axes of the robot, and the auxiliary axis: a gripper or a roll, besides pitch and yaw.

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::drive_status::DriveStatus;
use crate::core::events::EventList;
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::goal_extrapolation::GoalExtrapolation;
use crate::core::motion::velocity_limit::MotorTarget;
use crate::core::vector;
use crate::drive::{AxisFeedback, AxisRequest, Demand};
use crate::robot::Measurement;
use crate::units::{AUXILIARY, Counts, MAX_MOTORS, MotorVec, Nanos};

/// All axes, in the order of the motors.
#[derive(Debug)]
pub(crate) struct AxisGroup(Vec<AxisControl>);

impl AxisGroup {
    /// Axes whose drives have not reported yet.
    #[allow(clippy::disallowed_methods, reason = "a constructor, called before the loop")]
    pub(crate) fn new(config: &Config) -> Self {
        let axes = (0..config.motors().min(MAX_MOTORS)).filter_map(|motor| config.axis(motor));
        Self(axes.map(|axis| AxisControl::new(axis, config)).collect())
    }

    #[allow(clippy::disallowed_methods, reason = "for a replay, not for the loop")]
    pub(crate) fn from_snapshot(axes: &[Option<AxisControl>; MAX_MOTORS]) -> Self {
        Self(axes.iter().flatten().copied().collect())
    }

    pub(crate) fn to_snapshot(&self) -> [Option<AxisControl>; MAX_MOTORS] {
        self.per_motor(|axis| Some(*axis))
    }

    /// Number of axes.
    pub(crate) fn count(&self) -> usize {
        self.0.len()
    }

    pub(crate) fn all(&self, condition: impl Fn(&AxisControl) -> bool) -> bool {
        self.0.iter().all(condition)
    }

    pub(crate) fn for_each(&mut self, action: impl FnMut(&mut AxisControl)) {
        self.0.iter_mut().for_each(action);
    }

    pub(crate) fn update_feedback(
        &mut self,
        feedback: &[AxisFeedback; MAX_MOTORS],
        now: Nanos,
        events: &mut EventList,
    ) {
        for ((motor, axis), feedback) in (0..).zip(&mut self.0).zip(feedback) {
            axis.update_feedback(motor, feedback, now, events);
        }
    }

    pub(crate) fn feedback(&self) -> [AxisFeedback; MAX_MOTORS] {
        self.per_motor(|axis| *axis.feedback())
    }

    pub(crate) fn status(&self, now: Nanos) -> [Option<DriveStatus>; MAX_MOTORS] {
        self.per_motor(|axis| Some(axis.status(now)))
    }

    /// Updates the source of every setpoint for this tick's demands.
    pub(crate) fn update_sources(&mut self, demands: &[Demand], now: Nanos) {
        for (axis, demand) in self.0.iter_mut().zip(demands) {
            axis.update_source(*demand, now);
        }
    }

    /// Moves the setpoints one tick towards targets, every motor with its share of the velocity
    /// between a stop (0) and the target (1).
    pub(crate) fn track(&mut self, targets: &[MotorTarget; MAX_MOTORS], shares: &MotorVec) {
        for ((axis, target), share) in self.0.iter_mut().zip(targets).zip(shares) {
            axis.track(*target, *share);
        }
    }

    /// The shares with which the motors move on a straight line to their targets.
    pub(crate) fn straight_shares(&self, targets: &[MotorTarget; MAX_MOTORS]) -> MotorVec {
        let moves = || {
            self.0.iter().zip(targets).map(|(axis, target)| {
                let [stop, whole] = axis.next_velocities(*target);
                (target.position - axis.setpoint(), stop, whole)
            })
        };
        let along = moves().filter(|(left, ..)| *left != 0.0).map(|(left, _, whole)| whole / left);
        let pace = along.fold(f64::INFINITY, f64::min).max(0.0);
        vector::collect(moves().map(|(left, stop, whole)| {
            let range = whole - stop;
            if range == 0.0 { 0.0 } else { ((pace * left - stop) / range).clamp(0.0, 1.0) }
        }))
    }

    /// Where the setpoints come to rest when they stop from now on, counts.
    pub(crate) fn rest_positions(&self) -> MotorVec {
        vector::collect(self.0.iter().map(AxisControl::rest_position))
    }

    /// The most ticks that a setpoint takes to come to rest when all of them stop from now on.
    pub(crate) fn ticks_to_rest(&self) -> f64 {
        self.0.iter().map(AxisControl::ticks_to_rest).fold(0.0, f64::max)
    }

    pub(crate) fn is_moving(&self) -> bool {
        self.0.iter().any(|axis| axis.increment() != 0.0)
    }

    /// Whether any setpoint is further than this many counts from its target.
    pub(crate) fn is_away_from(&self, targets: &[MotorTarget; MAX_MOTORS], counts: f64) -> bool {
        let mut pairs = self.0.iter().zip(targets);
        pairs.any(|(axis, target)| (axis.clamp(target.position) - axis.setpoint()).abs() > counts)
    }

    pub(crate) fn keep_limits(&self, before: &[Option<AxisControl>; MAX_MOTORS]) -> bool {
        let mut pairs = self.0.iter().zip(before.iter().flatten());
        pairs.all(|(axis, before)| axis.keeps_limits(before))
    }

    /// Takes back what has happened since [`AxisGroup::to_snapshot`].
    pub(crate) fn restore(&mut self, before: &[Option<AxisControl>; MAX_MOTORS]) {
        for (axis, before) in self.0.iter_mut().zip(before.iter().flatten()) {
            *axis = *before;
        }
    }

    /// Clamps counts to the position limits.
    pub(crate) fn clamp(&self, mut counts: MotorVec) -> MotorVec {
        for (counts, axis) in counts.iter_mut().zip(&self.0) {
            *counts = axis.clamp(*counts);
        }
        counts
    }

    /// A motor is at a position limit, to a count.
    pub(crate) fn is_at_limit(&self, counts: &MotorVec) -> bool {
        let beyond = [1.0, -1.0].map(|by| counts.map(|counts| counts + by));
        beyond.into_iter().any(|beyond| self.clamp(beyond) != beyond)
    }

    pub(crate) fn allow(&self, positions: &[Counts; MAX_MOTORS]) -> bool {
        let mut pairs = self.0.iter().zip(positions);
        pairs.all(|(axis, position)| axis.allows(*position))
    }

    /// The first measurement that a motor has, with its index.
    pub(crate) fn first(
        &self,
        measurement: impl Fn(&AxisControl) -> Option<Measurement>,
    ) -> Option<Measurement> {
        (0..).zip(&self.0).find_map(|(motor, axis)| Some(measurement(axis)?.of_motor(motor)))
    }

    /// The first of these positions that is outside the limits of its axis.
    pub(crate) fn range_measurement(
        &self,
        positions: &[Counts; MAX_MOTORS],
    ) -> Option<Measurement> {
        let mut axes = (0..).zip(&self.0).zip(positions);
        axes.find_map(|((motor, axis), at)| Some(axis.range_measurement(*at)?.of_motor(motor)))
    }

    /// The setpoints before rounding, counts.
    pub(crate) fn setpoints(&self) -> MotorVec {
        vector::collect(self.0.iter().map(AxisControl::setpoint))
    }

    /// Changes of the setpoints in this tick, counts.
    pub(crate) fn increments(&self) -> MotorVec {
        vector::collect(self.0.iter().map(AxisControl::increment))
    }

    /// The setpoints as sent to the drives.
    pub(crate) fn targets(&self) -> [Counts; MAX_MOTORS] {
        self.per_motor(AxisControl::target)
    }

    /// Requests to the drives, for the gate. `common` gives sequence and command.
    pub(in crate::core) fn requests(
        &self,
        demands: &[Demand],
        common: &AxisRequest,
    ) -> [AxisRequest; MAX_MOTORS] {
        let mut requests = [AxisRequest::default(); MAX_MOTORS];
        for ((request, axis), demand) in requests.iter_mut().zip(&self.0).zip(demands) {
            *request = axis.request(*demand, common);
        }
        requests
    }

    /// One value per motor; the default where there is no axis.
    fn per_motor<T: Default + Copy>(&self, value: impl Fn(&AxisControl) -> T) -> [T; MAX_MOTORS] {
        let mut values = [T::default(); MAX_MOTORS];
        for (to, axis) in values.iter_mut().zip(&self.0) {
            *to = value(axis);
        }
        values
    }
}

/// The auxiliary axis in one tick, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct AuxiliaryReport {
    /// At the encoder position.
    pub measured: f64,
    /// At the setpoint before it is rounded to counts.
    pub setpoint: f64,
}

/// The auxiliary axis and the command that it follows.
///
/// It has no model, no hysteresis memory and no place in joint space: an angle is counts. Limits,
/// homing, faults and the gate are those of every axis. Its stream is separate from that of the
/// joints, under the same lease.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct AuxiliaryAxis {
    pub axis: AxisControl,
    counts_per_rad: f64,
    pub followed: Option<FollowedAngle>,
}

/// The last accepted command.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct FollowedAngle {
    pub client_id: u64,
    pub sequence: u64,
    pub stamp: Nanos,
    pub deadline: Nanos,
    /// Counts.
    pub goal: GoalExtrapolation<1>,
}

impl AuxiliaryAxis {
    /// `None`: the robot has none.
    pub(crate) fn new(config: &Config) -> Option<Self> {
        let axis = config.axis(AUXILIARY)?;
        // Counts per degree times degrees per rad.
        let counts_per_rad = axis.auxiliary_counts_per_deg?.to_degrees();
        Some(Self { axis: AxisControl::new(axis, config), counts_per_rad, followed: None })
    }

    /// The encoder position of an angle, rad.
    pub(crate) fn counts(&self, angle: f64) -> f64 {
        angle * self.counts_per_rad
    }

    pub(crate) fn target(&self, now: Nanos, tick: Nanos) -> Option<MotorTarget> {
        let ([here], [before]) = self.followed?.goal.evaluate(now, tick);
        let (here, before) = (self.axis.clamp(here), self.axis.clamp(before));
        Some(MotorTarget { position: here, increment: here - before })
    }

    pub(crate) fn report(&self) -> AuxiliaryReport {
        let angle = |counts: f64| counts / self.counts_per_rad;
        AuxiliaryReport {
            measured: angle(self.axis.feedback().position.as_f64()),
            setpoint: angle(self.axis.setpoint()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::AxisPhase;

    #[test]
    fn straight_shares_keep_motors_on_the_line() {
        let text = include_str!("../../../config/emulator.toml");
        let config = Config::parse(text, "emulator.toml".as_ref()).unwrap();
        for [to, other] in [[300.0, 250.0], [-60.0, 200.0], [150.0, 0.0], [-200.0, -200.0]] {
            let mut axes = AxisGroup::new(&config);
            let feedback = [40, -30].map(|counts| AxisFeedback {
                phase: AxisPhase::Enabled,
                position: Counts(counts),
                ..AxisFeedback::default()
            });
            axes.update_feedback(&feedback, Nanos(1), &mut EventList::new(Nanos(1)));
            for _ in 0..2 {
                axes.update_sources(&[Demand::Enabled; MAX_MOTORS], Nanos(1));
            }
            let (from, start) = (axes.setpoints(), axes.to_snapshot());
            let targets = [from[0] + to, from[1] + other].map(MotorTarget::fixed);
            for tick in 0..800 {
                let shares = axes.straight_shares(&targets);
                let is_fast = shares.iter().any(|share| *share > 0.999);
                assert!(is_fast || tick > 380, "as fast as one can: {shares:?}");
                let before = axes.to_snapshot();
                axes.track(&targets, &shares);
                assert!(axes.keep_limits(&before));
                let [a, b] = vector::difference(&axes.setpoints(), &from);
                let beside = (a * other - b * to) / to.hypot(other);
                assert!(beside.abs() < 1e-9, "{a} {b} in tick {tick} to {to} {other}");
            }
            assert!(!axes.keep_limits(&start), "all of it in one tick");
            for (at, target) in axes.setpoints().iter().zip(targets) {
                assert!((at - target.position).abs() < 1e-6, "{at} of {target:?}");
            }
        }
    }
}
