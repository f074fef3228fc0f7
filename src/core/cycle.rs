//! One tick of the controller, as a pure function of time and inputs.
//!
//! The order within a tick:
//!
//! 1. Look: the reports of the drives, what they mean, what the model makes of the encoders.
//! 2. Go on: faults, and what a state does by itself.
//! 3. Answer the state command.
//! 4. Judge the servo command; stop if the last one is stale.
//! 5. Move the set-points one step within the limits.
//! 6. Write down what the drives shall do, and what the world sees.
//!
//! Nothing here reads a clock, allocates, waits or panics; [`Cycle::step`] with the same inputs
//! gives the same outputs to the bit, so a recording of inputs can be replayed. The limits take
//! every tick to be as long as the configuration says: after ticks that were missed the motion goes
//! on where it was, and never catches up in a burst.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::command::admission::{Gate, Scene};
use crate::core::command::clutch::Clutch;
use crate::core::command::range_check::{Steps, setpoints};
use crate::core::event::Events;
use crate::core::faults::overload::Bucket;
use crate::core::faults::plausibility::Plausible;
use crate::core::model_slots::motion_history::Trail;
use crate::core::model_slots::slots::{Candidate, Moment, RememberedSlots, Slots};
use crate::core::motion::axis::Axis;
use crate::core::motion::conditioning::{Plan, Stroke};
use crate::core::motion::inverse_setpoint;
use crate::core::motion::joint_filter::Step;
use crate::core::motion::joint_space::{Joints, NotFinite};
use crate::core::motion::joint_trajectory::{Bounds, Profile};
use crate::core::states::command_transitions::{self, Verdict};
use crate::core::states::drive_status::{Expected, Sight, off};
use crate::core::states::own_transitions::{fail, progress};
use crate::core::states::state::{Cause, Follow, Inactive, Machine, Motion, State, Way};
use crate::core::{
    EventKind, External, Inputs, ModelReply, ModelRequest, Outputs, Report, ServoCommand,
    StateReply, StateRequest,
};
use crate::drive::{AxisFeedback, AxisRequest};
use crate::model::file::OutputUnit;
use crate::model::{Model, ModelId};
use crate::robot::{Fault, Refusal};
use crate::units::{Counts, MAX_MOTORS, MotorVec, Nanos, OutputVec};

/// How long an orderly end may take in all: stopping, settling and powering off, each within its
/// own limit, and a second to spare. After that the process may end with drives that are on.
const SHUTDOWN_LIMIT: Nanos = Nanos::from_millis(5500);

/// Everything that the loop remembers from tick to tick.
#[derive(Debug)]
pub struct Cycle {
    period: Nanos,
    stale: Nanos,
    lost: Nanos,
    steps: Steps,
    stroke_plan: Plan,
    bounds: Bounds,
    axes: Vec<Axis>,
    trail: Trail,
    models: Slots,
    lateness: Bucket,
    plausible: Plausible,
    machine: Machine,
    gate: Gate,
    clutch: Clutch,
    ticks: u64,
    stale_stops: u64,
    lost_events: u64,
    /// When the process was first seen to be asked to end.
    ending: Option<Nanos>,
}

/// Everything that changes from tick to tick, as it is between two ticks. About 20 kB, without
/// pointers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    axes: [Option<Axis>; MAX_MOTORS],
    trail: Trail,
    models: RememberedSlots,
    lateness: Bucket,
    plausible: Plausible,
    machine: Machine,
    gate: Gate,
    clutch: Clutch,
    ticks: u64,
    stale_stops: u64,
    lost_events: u64,
    ending: Option<Nanos>,
}

impl Snapshot {
    /// Ticks that had been run.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Models that were at hand.
    pub fn models(&self) -> impl Iterator<Item = ModelId> {
        self.models.models()
    }
}

/// What the set-points of a tick come from.
#[derive(Debug, Clone, Copy, Default)]
struct Guidance {
    goal: Option<OutputVec>,
    clipped: bool,
    command_stamp: Nanos,
    command_sequence: u64,
}

impl Cycle {
    /// DISABLED, with drives that have not reported yet. All memory that is ever needed is taken
    /// here.
    ///
    /// The configuration and the model have been checked before, also that they belong together
    /// ([`Model::check_robot`]).
    #[must_use]
    pub fn new(config: &Config, model: Option<Arc<Model>>) -> Self {
        let motors = config.motors().min(MAX_MOTORS);
        Self {
            period: config.control.period(),
            stale: Nanos::from_millis(config.limits.feedback_stale_ms),
            lost: Nanos::from_millis(config.limits.feedback_lost_ms),
            steps: Steps::new(&config.command),
            stroke_plan: Plan::new(config),
            bounds: Bounds::new(&config.move_jp),
            clutch: Clutch::new(config.command.motion_scale),
            axes: (0..motors)
                .filter_map(|motor| config.axis(motor))
                .map(|axis| Axis::new(axis, config))
                .collect(),
            trail: Trail::new(),
            lateness: Bucket::new(
                config.limits.overrun_ticks,
                Nanos::from_millis(config.limits.overrun_window_ms),
            ),
            plausible: Plausible::new(&config.plausibility),
            models: Slots::new(model.map(|model| Joints::new(model, config))),
            machine: Machine::new(),
            gate: Gate::new(&config.command),
            ticks: 0,
            stale_stops: 0,
            lost_events: 0,
            ending: None,
        }
    }

    /// Events that found no place in [`Outputs::events`] since the start.
    #[must_use]
    pub fn lost_events(&self) -> u64 {
        self.lost_events
    }

    /// Everything that changes from tick to tick. `None` while a model waits to be taken away by
    /// [`Cycle::retired`].
    #[must_use]
    pub fn snapshot(&self) -> Option<Snapshot> {
        let mut axes = [None; MAX_MOTORS];
        axes.iter_mut()
            .zip(&self.axes)
            .for_each(|(to, axis)| *to = Some(*axis));
        Some(Snapshot {
            axes,
            trail: self.trail,
            lateness: self.lateness,
            plausible: self.plausible,
            models: self.models.remembered()?,
            machine: self.machine,
            gate: self.gate,
            clutch: self.clutch,
            ticks: self.ticks,
            stale_stops: self.stale_stops,
            lost_events: self.lost_events,
            ending: self.ending,
        })
    }

    /// A cycle that goes on from a snapshot of one with the same configuration. Not for the loop.
    ///
    /// # Errors
    ///
    /// Names a model that `model` does not have.
    pub fn restored(
        config: &Config,
        snapshot: &Snapshot,
        model: impl Fn(ModelId) -> Option<Arc<Model>>,
    ) -> Result<Self, ModelId> {
        Ok(Self {
            axes: snapshot.axes.iter().flatten().copied().collect(),
            trail: snapshot.trail,
            lateness: snapshot.lateness,
            plausible: snapshot.plausible,
            models: Slots::restored(&snapshot.models, config, model)?,
            machine: snapshot.machine,
            gate: snapshot.gate,
            clutch: snapshot.clutch,
            ticks: snapshot.ticks,
            stale_stops: snapshot.stale_stops,
            lost_events: snapshot.lost_events,
            ending: snapshot.ending,
            ..Self::new(config, None)
        })
    }

    /// Whether [`Cycle::offer`] can take a candidate now.
    #[must_use]
    pub fn takes_candidates(&self) -> bool {
        self.models.open()
    }

    /// Stages a model, in place of the one that is staged. To be called between two ticks, and only
    /// while [`Cycle::takes_candidates`] says so.
    pub fn offer(&mut self, candidate: Candidate) {
        self.models.stage(candidate);
    }

    /// A model that is of no use any more, to be freed elsewhere. To be asked for after every tick.
    #[must_use]
    pub fn retired(&mut self) -> Option<Candidate> {
        self.models.retired()
    }

    /// One tick. `now` is the instant at which it began; it does not go backwards.
    pub fn step(&mut self, now: Nanos, inputs: &Inputs) -> Outputs {
        let mut events = Events::new(now);
        self.ticks = self.ticks.wrapping_add(1);
        if self.ticks == 1 {
            self.machine.begin(now);
        }
        let sight = self.look(now, inputs, &mut events);
        self.go_on(&sight, &mut events);
        self.shut_down(inputs.shutdown, &sight, &mut events);
        let refusal = inputs
            .request
            .as_ref()
            .map(|request| self.answer(request, &sight, &mut events));
        let model_reply = inputs
            .model
            .as_ref()
            .map(|request| self.change_model(request, &sight, &mut events));
        self.grip(now);
        self.gate.expire(now, &mut events);
        if let Some(command) = &inputs.servo {
            self.judge(command, &sight, &mut events);
        }
        self.stop_if_stale(now, &mut events);
        let guidance = self.advance(&sight, &mut events);
        let state = self.machine.state().operating();
        let (events, lost_events) = events.finish();
        self.lost_events = self.lost_events.saturating_add(lost_events);
        Outputs {
            requests: self.requests(&guidance),
            reply: inputs
                .request
                .zip(refusal)
                .map(|(request, refusal)| StateReply {
                    id: request.id,
                    refusal,
                    state,
                }),
            model_reply,
            report: self.report(&sight, &guidance),
            events,
            finished: self.finished(&sight),
        }
    }

    fn look(&mut self, now: Nanos, inputs: &Inputs, events: &mut Events) -> Sight {
        for ((motor, axis), feedback) in (0..).zip(&mut self.axes).zip(&inputs.feedback) {
            let (from, to) = (axis.feedback.phase, feedback.phase);
            if from != to {
                events.push(EventKind::Axis {
                    motor,
                    from,
                    to,
                    error_code: feedback.error_code,
                });
            }
            axis.hear(feedback, now);
        }
        let model_sound = self.observe(inputs.feedback.get(..self.axes.len()).unwrap_or_default());
        let late = self.lateness.add(u32::from(inputs.missed > 0), now);
        let implausible = self.look_from_outside(inputs.external.as_ref(), now);
        let mut axes = [None; MAX_MOTORS];
        axes.iter_mut()
            .zip(&self.axes)
            .for_each(|(sight, axis)| *sight = Some(axis.sight(now)));
        Sight {
            now,
            axes,
            stale: self.stale,
            lost: self.lost,
            homed: self.axes.iter().all(Axis::homed),
            in_range: self.axes.iter().all(Axis::in_range),
            at_rest: self.axes.iter().all(Axis::at_rest),
            homing_done: self.axes.iter().all(Axis::homing_done),
            reset_done: self.axes.iter().all(Axis::reset_done),
            model_sound,
            late,
            implausible,
        }
    }

    /// The model at the encoders; true if it is sound there, or if there is nothing to know yet.
    fn observe(&mut self, drives: &[AxisFeedback]) -> bool {
        match self.machine.state() {
            // The zero moves, and a jump of the counts is no motion.
            State::Disabled(Inactive::Homing { .. }) => {
                self.trail.forget();
                self.plausible.forget();
            }
            State::Disabled(_) | State::Enabled(_) | State::Paused | State::Fault(_) => {}
        }
        if drives.iter().any(|drive| drive.stamp == Nanos::ZERO) {
            return true;
        }
        self.trail.note(drives);
        self.models.others_mut().for_each(|joints| {
            joints.go_along(&self.trail);
        });
        self.models
            .active_mut()
            .is_none_or(|joints| joints.observe(&self.trail, drives).is_ok())
    }

    /// The camera against the model; true if they have been apart for too long.
    fn look_from_outside(&mut self, picture: Option<&External>, now: Nanos) -> bool {
        let Some(joints) = self.models.active().filter(|_| self.plausible.is_on()) else {
            return false;
        };
        let Some(report) = joints.report(None) else {
            return false;
        };
        let on = self.machine.state().expected() == Expected::On;
        let homed = self.axes.iter().all(Axis::homed);
        self.plausible.note(now, report.measured);
        self.plausible.is_broken(
            picture,
            joints.outputs(),
            on && homed && report.memory_known,
            now,
        )
    }

    fn go_on(&mut self, sight: &Sight, events: &mut Events) {
        if let Some((to, cause)) = progress(self.machine.state(), sight) {
            self.machine.change(to, cause, sight.now, events);
        }
    }

    fn shut_down(&mut self, asked: bool, sight: &Sight, events: &mut Events) {
        if !asked {
            return;
        }
        self.ending.get_or_insert(sight.now);
        if let Verdict::Change(to) = command_transitions::disable(self.machine.state(), sight) {
            self.machine.change(to, Cause::Shutdown, sight.now, events);
        }
    }

    fn answer(&mut self, request: &StateRequest, sight: &Sight, events: &mut Events) -> Refusal {
        let Err(refusal) = self.obey(request, sight, events) else {
            return Refusal::None;
        };
        self.gate.last_refusal = refusal;
        refusal
    }

    fn obey(
        &mut self,
        request: &StateRequest,
        sight: &Sight,
        events: &mut Events,
    ) -> Result<(), Refusal> {
        if request.client_id == 0 {
            return Err(Refusal::Malformed);
        }
        if self.ending.is_some() && command_transitions::sets_going(request.command) {
            return Err(Refusal::State);
        }
        let to = match command_transitions::judge(request.command, self.machine.state(), sight)? {
            Verdict::Nothing => return Ok(()),
            Verdict::Change(to) => to,
            Verdict::Home(to) => {
                self.axes.iter_mut().for_each(Axis::home);
                to
            }
            Verdict::Reset(to) => {
                self.axes.iter_mut().for_each(Axis::reset);
                to
            }
            Verdict::Unhome => {
                self.axes.iter_mut().for_each(Axis::unhome);
                *self.machine.state()
            }
            Verdict::Condition => {
                State::Enabled(Motion::Conditioning(self.condition(request.client_id)?))
            }
            Verdict::Move => State::Enabled(Motion::Moving(self.way(request, sight)?)),
            Verdict::Release => return self.release(request.client_id, sight.now, events),
        };
        self.machine
            .change(to, Cause::Command(request.command), sight.now, events);
        Ok(())
    }

    fn change_model(
        &mut self,
        request: &ModelRequest,
        sight: &Sight,
        events: &mut Events,
    ) -> ModelReply {
        let mut drives = [AxisFeedback::default(); MAX_MOTORS];
        drives
            .iter_mut()
            .zip(&self.axes)
            .for_each(|(drive, axis)| *drive = axis.feedback);
        let drives = drives
            .get(..self.axes.len())
            .filter(|drives| drives.iter().all(|drive| drive.stamp > Nanos::ZERO));
        let state = self.machine.state();
        let moment = Moment {
            now: sight.now,
            conditioning: state.conditioning(),
            following: state.in_joint_space(),
            drives,
            setpoints: &setpoints(&self.axes),
            trail: &self.trail,
        };
        let refusal = self
            .models
            .change(request, &moment, events)
            .err()
            .unwrap_or(Refusal::None);
        if refusal == Refusal::None {
            self.plausible.forget();
        }
        ModelReply {
            id: request.id,
            refusal,
        }
    }

    /// A stroke is motion, so it is not for a client while another one commands.
    fn condition(&self, client_id: u64) -> Result<Stroke, Refusal> {
        self.gate.unheld_by_others(client_id)?;
        self.stroke_plan.begin(
            setpoints(&self.axes),
            self.models.active().map(Joints::model),
        )
    }

    /// From where the set-points stand to a pose.
    fn way(&self, request: &StateRequest, sight: &Sight) -> Result<Way, Refusal> {
        let (to, entries) = request.pose.ok_or(Refusal::Malformed)?;
        let joints = self.models.active().ok_or(Refusal::NoModel)?;
        if entries as usize != joints.outputs() {
            return Err(Refusal::Malformed);
        }
        if joints.unit() != OutputUnit::Deg {
            return Err(Refusal::Unsupported);
        }
        let mut end = OutputVec::default();
        end.iter_mut()
            .zip(to)
            .take(entries as usize)
            .for_each(|(end, to)| *end = to);
        if !end.iter().all(|angle| angle.is_finite()) {
            return Err(Refusal::NotFinite);
        }
        if !sight.at_rest {
            return Err(Refusal::Busy);
        }
        self.gate.unheld_by_others(request.client_id)?;
        let from = joints.setpoint().ok_or(Refusal::DrivesNotReady)?;
        // Outside the hull the way would go on where the motors cannot: it ends where they end.
        let answer = joints.solve(&end).map_err(|_| Refusal::BadModel)?;
        let clipped = answer.clipped;
        let to = if clipped {
            joints.pose(&answer.counts).map_err(|_| Refusal::BadModel)?
        } else {
            end
        };
        let length = from
            .iter()
            .zip(to)
            .map(|(from, to)| (to - from) * (to - from))
            .sum::<f64>()
            .sqrt();
        Ok(Way {
            from,
            to,
            clipped,
            profile: Profile::new(length, &self.bounds),
            begun: sight.now,
        })
    }

    /// A client that gives the lease back does not command any more, so the robot stops.
    fn release(&mut self, client_id: u64, now: Nanos, events: &mut Events) -> Result<(), Refusal> {
        self.gate.release(client_id, events)?;
        if self
            .machine
            .state()
            .following()
            .is_some_and(|follow| follow.client_id == client_id)
        {
            self.machine.change(
                State::Enabled(Motion::Holding),
                Cause::Progress(None),
                now,
                events,
            );
        }
        Ok(())
    }

    fn grip(&mut self, now: Nanos) {
        let demands = self.machine.state().demands();
        self.axes
            .iter_mut()
            .zip(demands)
            .for_each(|(axis, demand)| axis.grip(demand, now));
    }

    fn judge(&mut self, command: &ServoCommand, sight: &Sight, events: &mut Events) {
        let (goal, clutch) = self
            .clutch
            .lead(command, self.models.active().and_then(Joints::setpoint));
        let command = &ServoCommand { goal, ..*command };
        match self.accepts(command, sight) {
            Ok(follow) => {
                self.gate.accept(command, sight.now, events);
                self.clutch = clutch;
                let motion = if command.clutched {
                    Motion::Holding
                } else {
                    Motion::Following(follow)
                };
                self.machine.change(
                    State::Enabled(motion),
                    Cause::Progress(None),
                    sight.now,
                    events,
                );
            }
            Err(refusal) => self.gate.refuse(command.client_id, refusal, events),
        }
    }

    fn accepts(&self, command: &ServoCommand, sight: &Sight) -> Result<Follow, Refusal> {
        let state = self.machine.state();
        let scene = Scene {
            now: sight.now,
            state: state.operating(),
            occupied: state.occupied(),
            homed: sight.homed,
            fresh: sight.fresh(),
        };
        let deadline = self.gate.permits(command, &scene)?;
        let course =
            self.steps
                .course(command, &self.axes, self.models.active(), state.following())?;
        let ServoCommand {
            client_id,
            sequence,
            stamp,
            ..
        } = *command;
        Ok(Follow {
            client_id,
            sequence,
            stamp,
            deadline,
            course,
        })
    }

    fn stop_if_stale(&mut self, now: Nanos, events: &mut Events) {
        let Some(follow) = self.machine.state().following() else {
            return;
        };
        let (client_id, age) = (follow.client_id, now.since(follow.stamp));
        if age >= follow.deadline {
            self.stale_stops = self.stale_stops.saturating_add(1);
            events.push(EventKind::StaleStop { client_id, age });
            self.machine.change(
                State::Enabled(Motion::Holding),
                Cause::Progress(None),
                now,
                events,
            );
        }
    }

    /// Moves the set-points. A model that gives nonsense is a fault, and then nothing moves.
    fn advance(&mut self, sight: &Sight, events: &mut Events) -> Guidance {
        let moved = self.guide(sight.now, events).and_then(|guidance| {
            self.place()?;
            Ok(guidance)
        });
        moved.unwrap_or_else(|_| {
            if !matches!(self.machine.state(), State::Fault(_)) {
                let (to, cause) = fail(self.machine.state(), Fault::Model, sight);
                self.machine.change(to, cause, sight.now, events);
            }
            Guidance::default()
        })
    }

    fn guide(&mut self, now: Nanos, events: &mut Events) -> Result<Guidance, NotFinite> {
        if !self.machine.state().in_joint_space()
            && let Some(joints) = self.models.active_mut()
        {
            joints.release();
        }
        match *self.machine.state() {
            State::Enabled(Motion::Following(follow)) => self.follow(&follow, now),
            State::Enabled(Motion::Conditioning(stroke)) => self.stroke(stroke, now, events),
            State::Enabled(Motion::Moving(way)) => self.go(&way, now, events),
            State::Enabled(Motion::Holding)
            | State::Disabled(_)
            | State::Paused
            | State::Fault(_) => {
                self.axes.iter_mut().for_each(Axis::stop);
                Ok(Guidance::default())
            }
        }
    }

    fn stroke(
        &mut self,
        stroke: Stroke,
        now: Nanos,
        events: &mut Events,
    ) -> Result<Guidance, NotFinite> {
        let next = stroke.after_tick();
        let stroke = next.unwrap_or(stroke);
        self.axes
            .iter_mut()
            .zip(stroke.targets())
            .for_each(|(axis, target)| axis.follow(target));
        let goal = self
            .models
            .active()
            .map(|joints| joints.pose(stroke.place()))
            .transpose()?;
        let motion = next.map_or(Motion::Holding, Motion::Conditioning);
        self.machine
            .change(State::Enabled(motion), Cause::Progress(None), now, events);
        Ok(Guidance {
            goal,
            ..Guidance::default()
        })
    }

    fn go(&mut self, way: &Way, now: Nanos, events: &mut Events) -> Result<Guidance, NotFinite> {
        let Some(joints) = self.models.active_mut() else {
            return Err(NotFinite);
        };
        let step = Step {
            here: way.at(now),
            before: way.at(now - self.period),
        };
        let aim = inverse_setpoint::lead(step, &way.to, &self.axes, joints, now, self.period)?;
        self.axes
            .iter_mut()
            .zip(aim.targets)
            .for_each(|(axis, target)| axis.follow(target));
        if way.is_over(now) && self.axes.iter().all(Axis::at_rest) {
            self.machine.change(
                State::Enabled(Motion::Holding),
                Cause::Progress(None),
                now,
                events,
            );
        }
        Ok(Guidance {
            goal: aim.goal,
            clipped: aim.clipped || way.clipped,
            ..Guidance::default()
        })
    }

    fn follow(&mut self, follow: &Follow, now: Nanos) -> Result<Guidance, NotFinite> {
        let aim = inverse_setpoint::take(
            &follow.course,
            &self.axes,
            self.models.active_mut(),
            now,
            self.period,
        )?;
        self.axes
            .iter_mut()
            .zip(aim.targets)
            .for_each(|(axis, target)| axis.follow(target));
        let (command_stamp, command_sequence) = (follow.stamp, follow.sequence);
        Ok(Guidance {
            goal: aim.goal,
            clipped: aim.clipped,
            command_stamp,
            command_sequence,
        })
    }

    /// Takes note of the set-points in joint space.
    fn place(&mut self) -> Result<(), NotFinite> {
        let Some(joints) = self.models.active_mut() else {
            return Ok(());
        };
        let mut moved = MotorVec::default();
        moved
            .iter_mut()
            .zip(&self.axes)
            .for_each(|(moved, axis)| *moved = axis.moved());
        joints.place(&setpoints(&self.axes), &moved, self.period)
    }

    fn requests(&self, guidance: &Guidance) -> [AxisRequest; MAX_MOTORS] {
        let mut requests = [AxisRequest::default(); MAX_MOTORS];
        let demands = self.machine.state().demands();
        for ((request, axis), demand) in requests.iter_mut().zip(&self.axes).zip(demands) {
            *request = AxisRequest {
                sequence: self.ticks,
                command_stamp: guidance.command_stamp,
                command_sequence: guidance.command_sequence,
                ..axis.request(demand)
            };
        }
        requests
    }

    fn report(&self, sight: &Sight, guidance: &Guidance) -> Report {
        let state = self.machine.state();
        let mut setpoints = [Counts::default(); MAX_MOTORS];
        let mut feedback = [AxisFeedback::default(); MAX_MOTORS];
        for ((setpoint, feedback), axis) in setpoints.iter_mut().zip(&mut feedback).zip(&self.axes)
        {
            (*setpoint, *feedback) = (axis.target(), axis.feedback);
        }
        Report {
            now: sight.now,
            state: state.operating(),
            since: self.machine.since(),
            fault: self.machine.fault(),
            homed: self.axes.iter().all(Axis::homed),
            busy: state.busy(self.axes.iter().all(Axis::at_rest)),
            holding: state.holding(),
            clipped: guidance.clipped,
            lease_client_id: self.gate.holder(),
            accepted: self.gate.accepted,
            refused: self.gate.refused,
            last_refusal: self.gate.last_refusal,
            stale_stops: self.stale_stops,
            models: self.models.shown(&self.trail),
            mark: self.trail.mark(),
            joint: self
                .models
                .active()
                .and_then(|joints| joints.report(guidance.goal)),
            setpoints,
            feedback,
        }
    }

    fn finished(&self, sight: &Sight) -> bool {
        let Some(since) = self.ending else {
            return false;
        };
        let done = match self.machine.state() {
            State::Disabled(Inactive::Idle) => true,
            State::Fault(_) => self.axes.iter().all(|axis| off(axis.feedback.phase)),
            State::Disabled(_) | State::Enabled(_) | State::Paused => false,
        };
        done || sight.now.since(since) >= SHUTDOWN_LIMIT
    }
}
