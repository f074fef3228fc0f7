//! Commands of the cycle: state commands, changes of model and virtual fixtures, servo commands.

use crate::core::command::admission::AdmissionContext;
use crate::core::command::authority::Access;
use crate::core::command::client_stream::FollowedCommand;
use crate::core::command::goals::{self, MovePlanning};
use crate::core::command::range_check::{CheckedGoal, UncheckedGoal, require};
use crate::core::command::sessions::{Arrival, StreamOf};
use crate::core::cycle::ControlCycle;
use crate::core::drive_status::DriveSummary;
use crate::core::events::{CycleEventKind, EventList};
use crate::core::inputs::{
    FixtureChange, ModelChange, ModelSwapRequest, ServoCommand, ServoGoal, StateRequest,
};
use crate::core::model_slots::{LoadedModels, SwapContext, activate, roll_back};
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::conditioning::ConditioningCycle;
use crate::core::motion::joint_model::JointModel;
use crate::core::outputs::ModelSwapReply;
use crate::core::states::command_transitions::{CommandEffect, command_effect, disable};
use crate::core::states::control_state::{
    ControlState, DisabledActivity, EnabledActivity, HOLDING,
};
use crate::core::states::state_machine::TransitionCause;
use crate::robot::{Measurement, OperatingState, Refusal, StateCommand, Stop};
use crate::units::{Nanos, OutputVec};

impl ControlCycle {
    /// Executes a state command. Returns the refusal, or [`Refusal::None`], with its measurement.
    pub(super) fn apply_command(
        &mut self,
        request: &StateRequest,
        summary: &DriveSummary,
        events: &mut EventList,
    ) -> (Refusal, Option<Measurement>) {
        let (client_id, command) = (request.client_id, request.command);
        self.admission.sessions.record_request(command, client_id, summary.now);
        let Err(refusal) = self.try_command(request, summary, events) else {
            self.admission.accept_request(command, client_id, summary.now);
            return (Refusal::None, None);
        };
        let measurement = match refusal {
            Refusal::Stale => Some(request.validity.measurement(summary.now)),
            Refusal::OutOfReach => self.move_planning(summary).measure_reach(request),
            _ => self.request_measurement(refusal, summary),
        };
        if self.admission.refuse_request(client_id, refusal, summary.now) {
            let kind = CycleEventKind::RequestRefused { client_id, command, refusal };
            events.push_measured(kind, measurement);
        }
        (refusal, measurement)
    }

    fn try_command(
        &mut self,
        request: &StateRequest,
        summary: &DriveSummary,
        events: &mut EventList,
    ) -> Result<(), Refusal> {
        if request.client_id == 0 {
            return Err(Refusal::Malformed);
        }
        if !request.command.only_stops() {
            request.validity.require_young(summary.now)?;
        }
        if request.command == StateCommand::Acknowledge {
            self.machine.require_seen(request.validity.stamp)?;
        }
        self.shutdown.require_allowed(request.command)?;
        let (client_id, state) = (request.client_id, self.machine.state());
        let effect = command_effect(request.command, state, summary)?;
        if effect != CommandEffect::NoChange {
            self.admission.require(Access::of(request), client_id, state.owner(), summary.now)?;
        }
        let next = match effect {
            CommandEffect::NoChange => return Ok(()),
            CommandEffect::Change(next) => {
                if matches!(request.command, StateCommand::Disable | StateCommand::Pause) {
                    self.admission.stopped(client_id, false, summary.now, events);
                }
                next
            }
            CommandEffect::Home => {
                // A search for a hard stop moves the motors.
                if self.homing_moves {
                    self.require_no_fixture()?;
                }
                self.for_each_axis(AxisControl::start_homing);
                ControlState::Disabled(DisabledActivity::Homing { since: summary.now, client_id })
            }
            CommandEffect::ResetFaults(next) => {
                self.for_each_axis(AxisControl::reset_fault);
                next
            }
            CommandEffect::Unhome => {
                self.for_each_axis(AxisControl::invalidate_zero);
                *self.machine.state()
            }
            CommandEffect::Condition => {
                // The motors cross the whole hull.
                self.require_no_fixture()?;
                let joints = self.models.active();
                let start = self.axes.setpoints();
                let model = joints.map(JointModel::model);
                let cycle =
                    ConditioningCycle::new(client_id, &self.conditioning_plan, start, model)?;
                if let Some(joints) = joints {
                    let is_allowed = |point| joints.allows_position(point);
                    require(cycle.corners().all(is_allowed), Refusal::Range)?;
                }
                ControlState::Enabled(EnabledActivity::Conditioning(cycle))
            }
            CommandEffect::Hold(next) => {
                self.admission.stopped(client_id, true, summary.now, events);
                self.release_auxiliary(None);
                let Some(next) = next else { return Ok(()) };
                next
            }
            CommandEffect::Move => {
                let trajectory = self.move_planning(summary).plan(request)?;
                if self.machine.state().trajectory().is_none() {
                    self.release_goal();
                }
                ControlState::Enabled(EnabledActivity::Moving(trajectory))
            }
            CommandEffect::ChangeFixtures => {
                return self.change_fixtures(request, summary.now, events);
            }
            CommandEffect::Release => {
                self.release_lease(client_id, summary, events);
                return Ok(());
            }
        };
        self.machine.change((next, TransitionCause::Command(request.command)), summary.now, events);
        Ok(())
    }

    /// The auxiliary axis may move during planning.
    fn move_planning(&self, summary: &DriveSummary) -> MovePlanning<'_> {
        MovePlanning {
            is_at_rest: self.axes.all(AxisControl::is_at_rest),
            current: self.machine.state().trajectory(),
            joints: self.models.active(),
            axes: &self.axes,
            fixtures: &self.fixtures,
            limits: &self.trajectory_limits,
            now: summary.now,
        }
    }

    /// Changes the virtual fixtures. Removing any requires a robot that follows no client.
    fn change_fixtures(
        &mut self,
        request: &StateRequest,
        now: Nanos,
        events: &mut EventList,
    ) -> Result<(), Refusal> {
        let change = request.fixture.as_ref().ok_or(Refusal::Malformed)?;
        match change {
            FixtureChange::SwitchOff | FixtureChange::RemoveAdded => {
                if self.machine.state().is_following_joints() {
                    return Err(Refusal::Busy);
                }
            }
            FixtureChange::SwitchOn | FixtureChange::Add(_) => {}
        }
        self.fixtures.change(change)?;
        // A cycle was planned without fixtures and crosses the whole hull.
        let state = self.machine.state();
        let is_blocked = match state.trajectory().zip(self.models.active()) {
            Some((trajectory, joints)) => {
                let ([here, turn, end], space) = (trajectory.way_left(now), joints.goal_space());
                let allows = |from, to| self.fixtures.allows_line(from, to, &space);
                !allows(&here, &turn) || !allows(&turn, &end)
            }
            None => state.is_conditioning() && self.fixtures.is_on(),
        };
        if is_blocked {
            self.machine.change((HOLDING, TransitionCause::BrokenOff(Stop::Fixture)), now, events);
        }
        events.push(CycleEventKind::Fixtures {
            client_id: request.client_id,
            active: self.fixtures.active_bits(),
        });
        Ok(())
    }

    /// Refuses motion that is not planned in joint space while virtual fixtures count.
    fn require_no_fixture(&self) -> Result<(), Refusal> {
        if self.fixtures.is_on() { Err(Refusal::Fixture) } else { Ok(()) }
    }

    /// Ends the activity of a client that returns the lease: the robot stops.
    fn release_lease(&mut self, client_id: u64, summary: &DriveSummary, events: &mut EventList) {
        self.admission.release_lease(client_id, events);
        self.release_auxiliary(Some(client_id));
        let state = self.machine.state();
        if state.owner() == Some(client_id) {
            let next = match disable(state, summary) {
                CommandEffect::Change(next) if state.is_homing() => next,
                _ => HOLDING,
            };
            self.machine.progress(next, summary.now, events);
        }
    }

    /// Ends all sessions if the robot left ENABLED in this tick.
    pub(super) fn end_sessions(&mut self, before: OperatingState, now: Nanos) {
        let state = self.machine.state().operating_state();
        if state != before && state != OperatingState::Enabled {
            let sessions = &mut self.admission.sessions;
            match state {
                OperatingState::Fault => sessions.stopped(0, false, now),
                _ => sessions.end_all(),
            }
        }
    }

    pub(super) fn swap_model(
        &mut self,
        request: &ModelSwapRequest,
        now: Nanos,
        events: &mut EventList,
    ) -> ModelSwapReply {
        let feedback = self.axes.feedback();
        let drives = feedback.get(..self.axes.count());
        let state = self.machine.state();
        let context = SwapContext {
            now,
            is_conditioning: state.is_conditioning(),
            is_following_joints: state.is_following_joints(),
            is_forced: request.forced,
            drives: drives.filter(|drives| drives.iter().all(|drive| drive.stamp > Nanos::ZERO)),
            setpoints: &self.axes.setpoints(),
            history: &self.history,
        };
        let active = |models: &LoadedModels| models.active().map(|joints| joints.model().id());
        let from = active(&self.models);
        // A new model would change the motion under the commanding client's hand.
        let client_id = request.client_id;
        let access = self.admission.require(Access::Alone, client_id, state.owner(), now);
        let allowed = request.validity.require_young(now).and(access);
        let result = allowed.and_then(|()| match request.change {
            ModelChange::Activate(id) => activate(&mut self.models, id, &context),
            ModelChange::Rollback => roll_back(&mut self.models, &context),
        });
        if result == Err(Refusal::StreamInterrupted) {
            // It is not silent.
            self.admission.refuse_request(client_id, Refusal::StreamInterrupted, now);
        }
        if result.is_ok() {
            let to = active(&self.models).unwrap_or_default();
            events.push(CycleEventKind::Model { from, to });
            self.plausibility.reset();
            if let Some(adaptation) = &mut self.adaptation {
                adaptation.begin(self.models.previous.as_deref_mut(), now);
            }
        }
        ModelSwapReply { id: request.id, refusal: result.err().unwrap_or(Refusal::None) }
    }

    pub(super) fn apply_servo_command(
        &mut self,
        command: &ServoCommand,
        summary: &DriveSummary,
        events: &mut EventList,
    ) {
        let joints = self.models.active();
        let place = goals::place(&command.goal);
        let led = ServoCommand { goal: goals::in_joints(command.goal, joints), ..*command };
        let before = self.machine.state().followed_command();
        let is_first = before.and_then(FollowedCommand::joint).is_none();
        let snake = joints.and_then(JointModel::setpoint);
        let (goal, clutch) = self.clutch.couple(&led, snake, is_first);
        // What is scaled or clutched does not go to the place.
        let place = place.filter(|_| goal == led.goal);
        let command = &ServoCommand { goal, ..*command };
        let arrival = Arrival { of: StreamOf::Joints, command, now: summary.now };
        match self.check_servo_command(arrival, place, summary) {
            Ok(followed) => {
                self.admission.accept(arrival, &self.axes.setpoints(), events);
                if is_first {
                    self.release_goal();
                }
                self.clutch = clutch;
                let following = ControlState::Enabled(EnabledActivity::Following(followed));
                let next = if command.clutched { HOLDING } else { following };
                self.machine.progress(next, summary.now, events);
            }
            Err(refusal) => {
                let client_id = command.client_id;
                if self.admission.refuse(arrival, refusal) {
                    let measurement = self.servo_measurement(refusal, command, summary);
                    let kind = CycleEventKind::Refused { client_id, refusal };
                    events.push_measured(kind, measurement);
                }
            }
        }
    }

    /// The next goal starts at the setpoint, without any offset of a previous goal.
    fn release_goal(&mut self) {
        self.fixtures.release_goal();
        if let Some(joints) = self.models.active_mut() {
            joints.release_goal();
        }
    }

    /// The goal of a command, for its check.
    pub(super) fn unchecked<'a>(
        &'a self,
        command: &'a ServoCommand,
        deadline: Nanos,
        now: Nanos,
    ) -> UncheckedGoal<'a> {
        let (axes, joints) = (&self.axes, self.models.active());
        let followed = self.machine.state().followed_command();
        UncheckedGoal { command, deadline, followed, axes, joints, now }
    }

    fn check_servo_command(
        &self,
        arrival: Arrival<'_>,
        place: Option<OutputVec>,
        summary: &DriveSummary,
    ) -> Result<FollowedCommand, Refusal> {
        let (command, state) = (arrival.command, self.machine.state());
        let context = AdmissionContext {
            state: state.operating_state(),
            unoccupied: state.require_unoccupied(),
            owner: state.owner(),
            is_homed: summary.is_homed,
            is_fresh: summary.is_fresh(),
        };
        let deadline = self.admission.check(arrival, &context)?;
        if matches!(command.goal, ServoGoal::Actuator(..)) {
            self.require_no_fixture()?;
        }
        let unchecked = self.unchecked(command, deadline, summary.now);
        let CheckedGoal { goal, requested, border, limit } = self.range_check.check(&unchecked)?;
        Ok(FollowedCommand {
            client_id: command.client_id,
            sequence: command.sequence,
            stamp: command.stamp,
            deadline,
            goal,
            requested,
            border,
            limit,
            place: place.map(|place| (place, goals::away_m(&place, &requested))),
        })
    }
}
