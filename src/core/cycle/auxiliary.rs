//! The auxiliary axis in the cycle: its drive is treated like any other; its stream is separate
//! from that of the joints.

use crate::core::command::admission::AdmissionContext;
use crate::core::command::range_check::{extend, require};
use crate::core::command::sessions::{Arrival, StreamOf};
use crate::core::cycle::ControlCycle;
use crate::core::drive_status::{DriveStatus, DriveSummary};
use crate::core::events::{CycleEventKind, EventList};
use crate::core::inputs::{ServoCommand, ServoGoal};
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::axis_group::FollowedAngle;
use crate::core::motion::gate::{Gate, Gated};
use crate::core::states::control_state::ControlState;
use crate::core::vector::collect;
use crate::drive::{AxisFeedback, AxisRequest};
use crate::robot::{Measurement, Refusal};
use crate::units::{AUXILIARY, MAX_AXES, Nanos};

impl ControlCycle {
    pub(super) fn all_axes(&self, condition: impl Fn(&AxisControl) -> bool) -> bool {
        self.axes.all(&condition) && self.auxiliary.as_ref().is_none_or(|it| condition(&it.axis))
    }

    pub(super) fn for_each_axis(&mut self, mut action: impl FnMut(&mut AxisControl)) {
        self.axes.for_each(&mut action);
        if let Some(auxiliary) = &mut self.auxiliary {
            action(&mut auxiliary.axis);
        }
    }

    /// The first measurement that an axis has, with its number.
    pub(super) fn first_axis(
        &self,
        measurement: impl Fn(&AxisControl) -> Option<Measurement>,
    ) -> Option<Measurement> {
        let auxiliary = || measurement(&self.auxiliary.as_ref()?.axis);
        let of_motors = self.axes.first(&measurement);
        of_motors.or_else(|| auxiliary().map(|it| it.of_motor(AUXILIARY as u8)))
    }

    pub(super) fn drive_status(&self, now: Nanos) -> [Option<DriveStatus>; MAX_AXES] {
        let [first, second] = self.axes.status(now);
        [first, second, self.auxiliary.as_ref().map(|auxiliary| auxiliary.axis.status(now))]
    }

    pub(super) fn update_auxiliary(
        &mut self,
        feedback: &AxisFeedback,
        now: Nanos,
        events: &mut EventList,
    ) {
        if let Some(auxiliary) = &mut self.auxiliary {
            auxiliary.axis.update_feedback(AUXILIARY as u8, feedback, now, events);
        }
    }

    pub(super) fn update_sources(&mut self, summary: &DriveSummary) {
        let (demands, now) = (self.machine.state().demands(summary), summary.now);
        self.axes.update_sources(&demands, now);
        if let Some(auxiliary) = &mut self.auxiliary {
            auxiliary.axis.update_source(demands[AUXILIARY], now);
        }
    }

    /// Ends following on the auxiliary axis; `client_id`: only if it follows that client.
    pub(super) fn release_auxiliary(&mut self, client_id: Option<u64>) {
        if let Some(auxiliary) = &mut self.auxiliary {
            let is_meant = |it: &FollowedAngle| client_id.is_none_or(|id| it.client_id == id);
            auxiliary.followed = auxiliary.followed.filter(|it| !is_meant(it));
        }
    }

    /// Takes a command, stops if the followed one is stale, and moves the setpoint by one tick.
    pub(super) fn move_auxiliary(
        &mut self,
        command: Option<&ServoCommand>,
        summary: &DriveSummary,
        events: &mut EventList,
    ) -> Option<Gated> {
        let arrival = |command| Arrival { of: StreamOf::Jaw, command, now: summary.now };
        if let Some(arrival) = command.map(arrival)
            && let Err(refusal) = self.follow_angle(arrival, summary, events)
        {
            let client_id = arrival.command.client_id;
            if self.admission.refuse(arrival, refusal) {
                let kind = CycleEventKind::Refused { client_id, refusal };
                // A goal out of range says nothing of the motors.
                let measurement = self.request_measurement(refusal, summary);
                events.push_measured(kind, measurement.filter(|_| refusal != Refusal::Range));
            }
        }
        let demand = self.machine.state().demands(summary)[AUXILIARY];
        let is_enabled = matches!(self.machine.state(), ControlState::Enabled(_));
        let can_move = is_enabled && summary.is_fresh() && summary.is_homed;
        let auxiliary = self.auxiliary.as_mut()?;
        if let Some(followed) = auxiliary.followed.filter(|_| can_move)
            && summary.now.duration_since(followed.stamp) >= followed.deadline
        {
            let (client_id, age) = (followed.client_id, summary.now.duration_since(followed.stamp));
            self.stale_stops = self.stale_stops.saturating_add(1);
            let measurement = Measurement::from_age(age, followed.deadline);
            events.push_measured(CycleEventKind::StaleStop { client_id, age }, Some(measurement));
            if !auxiliary.axis.is_at_rest() {
                let at = collect([auxiliary.axis.setpoint()].into_iter());
                self.admission.sessions.stopped_moving(StreamOf::Jaw, client_id, &at, summary.now);
            }
            auxiliary.followed = None;
        }
        auxiliary.followed = auxiliary.followed.filter(|_| can_move);
        let followed = auxiliary.followed;
        let common = AxisRequest {
            sequence: self.ticks,
            command_stamp: followed.map_or(Nanos::ZERO, |it| it.stamp),
            command_sequence: followed.map_or(0, |it| it.sequence),
            ..AxisRequest::default()
        };
        let target = auxiliary.target(summary.now, self.period);
        Some(Gate::pass_auxiliary(&mut auxiliary.axis, target, demand, &common))
    }

    fn follow_angle(
        &mut self,
        arrival: Arrival<'_>,
        summary: &DriveSummary,
        events: &mut EventList,
    ) -> Result<(), Refusal> {
        let auxiliary = self.auxiliary.as_ref().ok_or(Refusal::Unsupported)?;
        let (command, state) = (arrival.command, self.machine.state());
        let context = AdmissionContext {
            state: state.operating_state(),
            // Trajectories and conditioning cycles do not move it, so their client may.
            unoccupied: Ok(()),
            owner: state.owner(),
            is_homed: summary.is_homed,
            is_fresh: summary.is_fresh(),
        };
        let deadline = self.admission.check(arrival, &context)?;
        let ServoGoal::Joint([angle, ..], 1) = command.goal else {
            return Err(Refusal::Malformed);
        };
        require(!command.clutched, Refusal::Malformed)?;
        let counts = auxiliary.counts(angle);
        require(auxiliary.axis.clamp(counts) == counts, Refusal::Range)?;
        let before = auxiliary.followed.map(|followed| followed.goal);
        let from = before.map_or(auxiliary.axis.setpoint(), |goal| goal.goal[0]);
        let largest = self.range_check.largest_counts(before.is_none());
        require((counts - from).abs() <= largest, Refusal::StepTooLarge)?;
        let goal = extend(before.as_ref(), [counts], command.stamp);
        let setpoint = collect([auxiliary.axis.setpoint()].into_iter());
        self.admission.accept(arrival, &setpoint, events);
        if let Some(auxiliary) = &mut self.auxiliary {
            auxiliary.followed = Some(FollowedAngle {
                client_id: command.client_id,
                sequence: command.sequence,
                stamp: command.stamp,
                deadline,
                goal,
            });
        }
        Ok(())
    }
}
