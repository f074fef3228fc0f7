//! One tick of the controller, as a pure function of time and inputs.
//!
//! The order within a tick:
//!
//! 1. Update feedback: the drives, the model at the encoders, the fault monitors.
//! 2. Automatic transitions: faults, timeouts, end of an activity, shutdown.
//! 3. The state command, then the model swap.
//! 4. The servo command; a stop if the followed command is stale.
//! 5. Move the setpoints by one tick within the limits; the same for the auxiliary axis.
//! 6. Write the requests to the drives and the report.
//!
//! Nothing here reads a clock, allocates, waits or panics. [`ControlCycle::step`] with the same
//! inputs gives the same outputs to the bit, so recorded inputs can be replayed. The limits take
//! every tick to be as long as configured: after missed ticks, the motion continues where it was
//! and never catches up in a burst.

mod auxiliary;
mod commands;
mod events;
mod setpoint_generation;
pub(super) mod snapshot;

use std::sync::Arc;

use crate::config::{Config, HomingMethod};
use crate::core::adaptation::{Adaptation, Surroundings};
use crate::core::command::admission::CommandAdmission;
use crate::core::command::goals::Clutch;
use crate::core::command::range_check::RangeCheck;
use crate::core::command::sessions::StreamOf;
use crate::core::drive_status::{DriveStatus, DriveSummary, ExpectedPower};
use crate::core::events::fold::{ClipEvents, EventFold, OtherCameras};
use crate::core::events::{CycleEventKind, EventList, PlausibilityCheck};
use crate::core::faults::OverrunMonitor;
use crate::core::faults::plausibility::PlausibilityMonitor;
use crate::core::inputs::{CycleInputs, ExternalPose};
use crate::core::model_slots::{LoadedModels, ModelCandidate};
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::axis_group::{AuxiliaryAxis, AxisGroup};
use crate::core::motion::conditioning::ConditioningPlan;
use crate::core::motion::gate::{Gate, JointSpace, Motion, Passed};
use crate::core::motion::joint_model::position_history::PositionHistory;
use crate::core::motion::joint_model::{JointModel, NotFinite};
use crate::core::motion::joint_trajectory::TrajectoryLimits;
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::outputs::{CycleOutputs, CycleReport, StateReply};
use crate::core::states::automatic_transitions::{Shutdown, enter_fault};
use crate::core::states::command_transitions::{CommandEffect, disable};
use crate::core::states::control_state::{ControlState, HOLDING};
use crate::core::states::state_machine::{StateMachine, TransitionCause};
use crate::drive::{AxisPhase, AxisRequest};
use crate::model::Model;
use crate::robot::{Fault, Measurement};
use crate::units::Nanos;
use setpoint_generation::{GeneratedSetpoint, MotionTick};

/// The controller and its state from tick to tick.
#[derive(Debug)]
pub struct ControlCycle {
    period: Nanos,
    stale_after: Nanos,
    lost_after: Nanos,
    pub(super) range_check: RangeCheck,
    /// A drive searches for a hard stop when it is homed.
    homing_moves: bool,
    pub(super) conditioning_plan: ConditioningPlan,
    pub(super) trajectory_limits: TrajectoryLimits,
    pub(super) axes: AxisGroup,
    /// `None` if the robot has none.
    pub(super) auxiliary: Option<AuxiliaryAxis>,
    pub(super) history: PositionHistory,
    pub(super) models: LoadedModels,
    pub(super) overruns: OverrunMonitor,
    pub(super) plausibility: PlausibilityMonitor,
    pub(super) plausibility_check: PlausibilityCheck,
    /// `None` if it is switched off.
    pub(super) adaptation: Option<Adaptation>,
    pub(super) other_cameras: OtherCameras,
    pub(super) machine: StateMachine,
    pub(super) admission: CommandAdmission,
    pub(super) clutch: Clutch,
    pub(super) fixtures: VirtualFixtures,
    pub(super) gate: Gate,
    pub(super) feedback_stops: EventFold,
    pub(super) clips: ClipEvents,
    pub(super) ticks: u64,
    pub(super) stale_stops: u64,
    pub(super) lost_events: u64,
    pub(super) shutdown: Shutdown,
}

impl ControlCycle {
    /// DISABLED, with drives that have not reported yet. Allocates all memory that is ever needed.
    ///
    /// Configuration and model must have been checked, including that they match
    /// ([`Model::check_robot`]).
    pub fn new(config: &Config, model: Option<Arc<Model>>) -> Self {
        let limits = &config.limits;
        Self {
            period: config.control.period(),
            stale_after: config.feedback_stale(),
            lost_after: config.feedback_lost(),
            range_check: RangeCheck::new(&config.command),
            homing_moves: config.axes().any(|axis| axis.homing != HomingMethod::Here),
            conditioning_plan: ConditioningPlan::new(config),
            trajectory_limits: TrajectoryLimits::new(config.joint_limits.velocity_deg_s),
            clutch: Clutch::new(config.command.motion_scale),
            fixtures: VirtualFixtures::new(&config.virtual_fixtures, config.control.period()),
            gate: Gate::new(config.control.period()),
            feedback_stops: EventFold::default(),
            clips: ClipEvents::default(),
            axes: AxisGroup::new(config),
            auxiliary: AuxiliaryAxis::new(config),
            history: PositionHistory::default(),
            overruns: OverrunMonitor::new(limits.overrun_ticks),
            plausibility: PlausibilityMonitor::new(limits.plausibility_deg),
            plausibility_check: PlausibilityCheck::default(),
            other_cameras: OtherCameras::default(),
            adaptation: Adaptation::new(config),
            models: LoadedModels::new(model.map(|model| JointModel::new(model, config))),
            machine: StateMachine::new(),
            admission: CommandAdmission::new(&config.command),
            ticks: 0,
            stale_stops: 0,
            lost_events: 0,
            shutdown: Shutdown::default(),
        }
    }

    /// Number of events since the start that did not fit into [`CycleOutputs::events`].
    pub fn lost_events(&self) -> u64 {
        self.lost_events
    }

    /// Whether [`ControlCycle::stage_model`] can take a model now.
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    pub fn can_stage_model(&self) -> bool {
        self.models.can_retire()
    }

    /// Stages a model in place of the staged one. Call it between two ticks, and only while
    /// [`ControlCycle::can_stage_model`] is true.
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    pub fn stage_model(&mut self, candidate: ModelCandidate) {
        self.models.stage(candidate);
    }

    /// A model that is no longer needed, to be freed by another thread. Call it after every tick.
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    pub fn take_retired(&mut self) -> Option<ModelCandidate> {
        self.models.take_retired()
    }

    /// One tick. `now` is the time at which it began; it must not go backwards.
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    pub fn step(&mut self, now: Nanos, inputs: &CycleInputs) -> CycleOutputs {
        let mut list = EventList::new(now);
        let events = &mut list;
        self.ticks = self.ticks.wrapping_add(1);
        if self.ticks == 1 {
            self.machine.start(now);
        }
        let before = self.machine.state().operating_state();
        let summary = self.update_feedback(now, inputs, events);
        self.follow_transition(&summary, events);
        if inputs.shutdown {
            self.shut_down(&summary, events);
        }
        let state_request = inputs.request.as_ref();
        let outcome = state_request.map(|request| self.apply_command(request, &summary, events));
        let model_request = inputs.model.as_ref();
        let model_reply = model_request.map(|request| self.swap_model(request, now, events));
        self.update_sources(&summary);
        self.admission.expire_lease(self.machine.state().is_occupied(), now, events);
        if let Some(command) = &inputs.servo {
            self.apply_servo_command(command, &summary, events);
        }
        self.stop_if_stale(now, events);
        let (setpoint, passed) = self.move_setpoints(&summary, events);
        self.report_clip(&setpoint, now, events);
        let auxiliary = self.move_auxiliary(inputs.jaw.as_ref(), &summary, events);
        self.end_sessions(before, now);
        let (events, lost_events) = list.finish();
        self.lost_events = self.lost_events.saturating_add(lost_events);
        let state = self.machine.state();
        CycleOutputs {
            requests: passed.requests(
                &self.axes,
                &state.demands(&summary),
                &AxisRequest {
                    sequence: self.ticks,
                    command_stamp: setpoint.command_stamp,
                    command_sequence: setpoint.command_sequence,
                    ..AxisRequest::default()
                },
            ),
            auxiliary,
            reply: state_request.zip(outcome).map(|(request, (refusal, measurement))| StateReply {
                id: request.id,
                refusal,
                state: state.operating_state(),
                measurement,
            }),
            model_reply,
            report: self.report(now, &setpoint),
            events,
            finished: self.shutdown.is_finished(state, &summary),
        }
    }

    fn update_feedback(
        &mut self,
        now: Nanos,
        inputs: &CycleInputs,
        events: &mut EventList,
    ) -> DriveSummary {
        let was_homed = self.axes.all(AxisControl::is_homed);
        let was_homing = !self.axes.all(|axis| axis.feedback().phase != AxisPhase::Homing);
        self.axes.update_feedback(&inputs.feedback, now, events);
        self.update_auxiliary(&inputs.auxiliary, now, events);
        if was_homed && !self.axes.all(AxisControl::is_homed) {
            // Count changes while the zero gets lost are not motion.
            self.history.start_epoch();
        }
        let is_model_finite = self.update_models(was_homing, now).is_ok();
        self.adapt(inputs.external.as_ref(), now, events);
        if let Some(frames) = self.other_cameras.update(inputs.ignored_frames, now) {
            events.push(CycleEventKind::OtherCamera { frames });
        }
        let is_late = self.overruns.add(u32::from(inputs.missed > 0), now);
        let is_overrun = is_late || inputs.missed == u32::MAX;
        let check = self.plausibility_check;
        let is_implausible = self.is_implausible(inputs.external.as_ref(), now);
        if self.plausibility_check != check {
            events.push(CycleEventKind::Plausibility(self.plausibility_check));
        }
        DriveSummary {
            now,
            axes: self.drive_status(now),
            stale_after: self.stale_after,
            lost_after: self.lost_after,
            is_homed: self.all_axes(AxisControl::is_homed),
            is_in_range: self.all_axes(AxisControl::is_in_range),
            is_at_rest: self.all_axes(AxisControl::is_at_rest),
            is_homing_done: self.all_axes(AxisControl::is_homing_done),
            is_reset_done: self.all_axes(AxisControl::is_reset_done),
            is_model_finite,
            is_overrun,
            is_implausible,
        }
    }

    /// Replays the new positions on all models. Without a feedback of every drive there is nothing
    /// to replay.
    fn update_models(&mut self, was_homing: bool, now: Nanos) -> Result<(), NotFinite> {
        // The zero moves, also of a homing that is stopped: a jump of the counts is not motion.
        if was_homing || self.machine.state().is_homing() {
            self.history.start_epoch();
            self.plausibility.reset();
            if let Some(adaptation) = &mut self.adaptation {
                adaptation.begin(self.models.active_mut(), now);
            }
        }
        let feedback = self.axes.feedback();
        let drives = feedback.get(..self.axes.count()).unwrap_or_default();
        if drives.iter().any(|drive| drive.stamp == Nanos::ZERO) {
            return Ok(());
        }
        self.history.record(drives);
        self.models.replay_inactive(&self.history);
        let drift = self.adaptation.as_mut().map(|adaptation| &mut adaptation.state.memories);
        let joints = self.models.active_mut();
        joints.map_or(Ok(()), |joints| joints.update_feedback(&self.history, drives, drift))
    }

    /// Follows the drift of the active model by a frame of the camera.
    fn adapt(&mut self, frame: Option<&ExternalPose>, now: Nanos, events: &mut EventList) {
        let (Some(adaptation), Some(joints)) = (&mut self.adaptation, self.models.active_mut())
        else {
            return;
        };
        let state = self.machine.state();
        let surroundings = Surroundings {
            now,
            is_following: state.is_following_joints(),
            is_unsettled: !matches!(state, ControlState::Enabled(_)) || state.is_conditioning(),
            is_disabled: matches!(state, ControlState::Disabled(_)),
        };
        adaptation.step(joints, frame, &surroundings, events);
    }

    fn is_implausible(&mut self, measured: Option<&ExternalPose>, now: Nanos) -> bool {
        let Some(joints) = self.models.active().filter(|_| self.plausibility.is_on()) else {
            return false;
        };
        let Some(report) = joints.report(None) else { return false };
        let is_on = self.machine.state().expected_power() == ExpectedPower::On;
        let is_checked = is_on && self.axes.all(AxisControl::is_homed) && report.memory_known;
        // A loose wire must be detected even if it was followed as drift.
        let mut calibrated = report.measured;
        if let Some(adaptation) = &self.adaptation
            && let Some(pose) = adaptation.calibrated_pose()
        {
            for (calibrated, pose) in calibrated.iter_mut().zip(pose) {
                *calibrated = pose;
            }
        }
        self.plausibility.record_estimates(now, [report.measured, calibrated]);
        let outputs = joints.outputs();
        let is_implausible = self.plausibility.is_implausible(measured, outputs, is_checked, now);
        self.plausibility_check = self.plausibility.check(now);
        is_implausible
    }

    fn shut_down(&mut self, summary: &DriveSummary, events: &mut EventList) {
        self.shutdown.request(summary.now);
        if let CommandEffect::Change(next) = disable(self.machine.state(), summary) {
            self.machine.change((next, TransitionCause::Shutdown), summary.now, events);
        }
    }

    fn stop_if_stale(&mut self, now: Nanos, events: &mut EventList) {
        if let Some(followed) = self.machine.state().followed_command()
            && let Some(age) = followed.stale_age(now)
        {
            let client_id = followed.client_id;
            let measurement = Measurement::from_age(age, followed.deadline);
            self.stale_stops = self.stale_stops.saturating_add(1);
            events.push_measured(CycleEventKind::StaleStop { client_id, age }, Some(measurement));
            if !self.axes.all(AxisControl::is_at_rest) {
                let at = self.axes.setpoints();
                self.admission.sessions.stopped_moving(StreamOf::Joints, client_id, &at, now);
            }
            self.machine.progress(HOLDING, now, events);
        }
    }

    /// Moves the setpoints. If the model gives values that are not finite, that is a fault, and the
    /// report shows no goal.
    fn move_setpoints(
        &mut self,
        summary: &DriveSummary,
        events: &mut EventList,
    ) -> (GeneratedSetpoint, Passed) {
        self.try_move_setpoints(summary.now, events).unwrap_or_else(|NotFinite| {
            if !matches!(self.machine.state(), ControlState::Fault(_)) {
                let fault = enter_fault(self.machine.state(), Fault::Model, summary);
                self.machine.change(fault, summary.now, events);
            }
            (GeneratedSetpoint::default(), self.gate.keep())
        })
    }

    fn try_move_setpoints(
        &mut self,
        now: Nanos,
        events: &mut EventList,
    ) -> Result<(GeneratedSetpoint, Passed), NotFinite> {
        let mut motion = MotionTick {
            axes: &self.axes,
            joints: self.models.active_mut(),
            fixtures: &mut self.fixtures,
            now,
            period: self.period,
        };
        let mut setpoint = motion.generate(self.machine.state())?;
        let passed = self.pass_gate(&setpoint)?;
        if passed.is_held() && self.machine.state().is_occupied() {
            // A cycle and a move wait for their motors.
            setpoint.next = None;
        }
        if let Some(limit) = passed.blocked_by() {
            self.end_at_limit(limit, now, events);
        }
        if let Some(region) = self.fixtures.begun_limit(now) {
            events.push(CycleEventKind::FixtureLimit { region });
        }
        if let Some(next) = setpoint.next {
            self.machine.progress(ControlState::Enabled(next), now, events);
        }
        if let Some(joints) = self.models.active_mut() {
            let (setpoints, increments) = (self.axes.setpoints(), self.axes.increments());
            joints.update_setpoint(&setpoints, &increments, self.period)?;
        }
        Ok((setpoint, passed))
    }

    fn pass_gate(&mut self, setpoint: &GeneratedSetpoint) -> Result<Passed, NotFinite> {
        let adaptation = &self.adaptation;
        let fixtures = &mut self.fixtures;
        let space = self.models.active().map(|joints| {
            let calibrated = adaptation.as_ref().and_then(|it| it.calibrated_memory(joints));
            JointSpace { joints, fixtures, calibrated }
        });
        self.gate.pass(&mut self.axes, &setpoint.motion.unwrap_or(Motion::Stop), space)
    }

    fn report(&self, now: Nanos, setpoint: &GeneratedSetpoint) -> CycleReport {
        let state = self.machine.state();
        let (joints, drives) = (self.models.active(), self.drive_status(now));
        CycleReport {
            now,
            state: state.operating_state(),
            since: self.machine.since(),
            fault: self.machine.fault(),
            homed: self.all_axes(AxisControl::is_homed),
            busy: state.is_busy(self.all_axes(AxisControl::is_at_rest)),
            holding: state.is_holding(),
            at_rest: self.all_axes(AxisControl::is_at_rest),
            off: drives.iter().flatten().all(DriveStatus::is_known_off),
            stopped: drives.iter().flatten().all(DriveStatus::is_known_stopped),
            broken_off: self.machine.broken_off(),
            clipped: setpoint.clip.is_some(),
            fixtures: self.fixtures.active_bits(),
            limited_by_fixture: self.fixtures.limited_by,
            plausibility: self.plausibility_check,
            lease_client_id: self.admission.commander(state.owner()),
            accepted: self.admission.accepted,
            refused: self.admission.refused,
            last_refusal: self.admission.last_refusal,
            refusals: self.admission.refusals(),
            stale_stops: self.stale_stops,
            models: self.models.report(&self.history),
            adaptation: self.adaptation.as_ref().map(|adaptation| adaptation.report(joints)),
            mark: self.history.cursor,
            joint: joints.and_then(|joints| joints.report(setpoint.goal)),
            setpoints: self.axes.targets(),
            feedback: self.axes.feedback(),
            auxiliary: self.auxiliary.as_ref().map(AuxiliaryAxis::report),
        }
    }
}
