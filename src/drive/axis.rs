//! One axis while the port thread runs: a state machine without I/O.
//!
//! The port thread asks it for the next exchange, carries that out, and hands the outcome back. What the control loop
//! demands is taken anew every time, so that the newest set-point is the one that is written.
//!
//! After a fault, a loss, a failure or an interference from outside the axis does not come on again by itself: the
//! demand must have been something else than enabled in between.

mod ask;
mod cadence;
mod enabling;
mod homing;
mod power;
mod stage;

use std::ops::RangeInclusive;

use crate::config::AxisConfig;
use crate::units::{Counts, Nanos};

use super::cia402::{Controlword, Goal, State, Statusword};
use super::error::{AxisFault, LinkError};
use super::event::{Failure, PortEvent, PortEventKind};
use super::family::Drive;
use super::object::{Address, Value};
use super::request::AbortCode;
use super::{AxisFeedback, AxisRequest, Demand, LinkCounters, WrittenTarget};

pub(super) use ask::{Access, Ask};
use cadence::{Cadence, Extra, Slot};
use enabling::Enabling;
use homing::Homing;
use power::Power;
use stage::{FaultStep, Rearm, Stage};

/// How long enabling may take.
const ENABLE_DEADLINE: Nanos = Nanos::from_millis(2000);

/// How long the drive may take to report quick stop, and then to stand still.
const STOP_DEADLINE: Nanos = Nanos::from_millis(1000);

/// How long switching off in order may take before the power is cut, and cutting it before it is tried again.
const OFF_DEADLINE: Nanos = Nanos::from_millis(2000);

/// How long homing may take. Taking the present position as zero takes a few exchanges.
const HOMING_DEADLINE: Nanos = Nanos::from_millis(10_000);

/// How long the drive may take to leave the fault state.
const RESET_DEADLINE: Nanos = Nanos::from_millis(500);

/// Exchanges in a row without an answer, on a line that is in step, that make an axis lost.
const MISSES: u32 = 3;

/// Distance between two positions in a row that counts as standing still: an encoder may waver by a count.
const STILL_COUNTS: u32 = 1;

/// Where events go.
pub(super) type Events<'a> = &'a mut dyn FnMut(PortEvent);

/// How a step of a procedure ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Progress {
    Going,
    Done,
    Failed(Failure),
}

/// What an exchange brought: the value read (0 for a write), and when.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reply {
    pub(super) raw: u32,
    pub(super) sent: Nanos,
    pub(super) received: Nanos,
}

/// One axis.
#[derive(Debug)]
pub(super) struct Axis {
    motor: usize,
    limits: RangeInclusive<i32>,
    drive: &'static dyn Drive,
    stage: Stage,
    cadence: Cadence,
    feedback: AxisFeedback,
    still: bool,
    misses: u32,
    reported: Reported,
}

/// What was reported last, so that repeats are not.
#[derive(Debug, Clone, Copy, Default)]
struct Reported {
    target: bool,
    refusal: Option<(Address, AbortCode)>,
    fault: Option<AxisFault>,
}

impl Axis {
    pub(super) fn new(config: &AxisConfig, drive: &'static dyn Drive) -> Self {
        Self {
            motor: config.motor,
            limits: config.position_min_counts.0..=config.position_max_counts.0,
            drive,
            stage: Stage::Starting,
            cadence: Cadence::default(),
            feedback: AxisFeedback::default(),
            still: false,
            misses: 0,
            reported: Reported::default(),
        }
    }

    /// What the control loop shall see.
    pub(super) fn feedback(&self, counters: LinkCounters) -> AxisFeedback {
        AxisFeedback { counters, ..self.feedback }
    }

    pub(super) fn is_lost(&self) -> bool {
        self.stage == Stage::Lost
    }

    /// A request to be off, and nothing else.
    pub(super) fn rest(&self) -> AxisRequest {
        let AxisFeedback { fault_resets, homings, .. } = self.feedback;
        AxisRequest { demand: Demand::Disabled, fault_resets, homings, ..AxisRequest::default() }
    }

    /// There is nothing left to switch off, or no way to.
    pub(super) fn is_at_rest(&self) -> bool {
        matches!(self.stage, Stage::Disabled(_) | Stage::Faulted(_) | Stage::Lost)
    }

    /// The power stage is known to be off.
    pub(super) fn is_off(&self) -> bool {
        matches!(self.stage, Stage::Disabled(_)) || Statusword(self.feedback.statusword).state() == Some(State::Fault)
    }

    /// The next exchange, towards what the control loop demands.
    pub(super) fn next(&mut self, request: &AxisRequest, now: Nanos, events: Events<'_>) -> Ask {
        self.check_deadline(now, events);
        self.obey(request, now, events);
        self.acknowledge(request, events);
        if self.stage == Stage::Enabled { self.follow(request, events) } else { self.go_on() }
    }

    fn follow(&mut self, request: &AxisRequest, events: Events<'_>) -> Ask {
        match self.cadence.following() {
            Slot::Lead if self.limits.contains(&request.target.0) => Ask::Follow(*request),
            // Clamping would move the motor somewhere that no one asked for.
            Slot::Lead => {
                self.report_target(request.target, events);
                self.cadence.following();
                Ask::Position
            }
            Slot::Position => Ask::Position,
            Slot::Extra(extra) => extra_ask(extra),
        }
    }

    fn go_on(&mut self) -> Ask {
        match (self.cadence.idle(), self.stage.ask(self.drive.parts())) {
            ((Slot::Position, _), _) => Ask::Position,
            ((_, _), Some(ask)) => ask,
            ((_, extra), None) => extra_ask(extra),
        }
    }

    /// Starts what the demand asks for.
    fn obey(&mut self, request: &AxisRequest, now: Nanos, events: Events<'_>) {
        let homing = request.homings != self.feedback.homings;
        let reset = request.fault_resets != self.feedback.fault_resets;
        match (self.stage, request.demand) {
            (Stage::Disabled(_), Demand::Disabled | Demand::QuickStop) if homing => {
                self.enter(Stage::Homing(Homing::Position, now + HOMING_DEADLINE, request.homings), events);
            }
            (Stage::Disabled(Rearm::Free) | Stage::QuickStopped(Rearm::Free, _), Demand::Enabled) => {
                self.enter(Stage::Enabling(Enabling::LimitMin, now + ENABLE_DEADLINE), events);
            }
            (Stage::Disabled(Rearm::Held), Demand::Disabled | Demand::QuickStop) => {
                self.stage = Stage::Disabled(Rearm::Free);
            }
            (Stage::QuickStopped(Rearm::Held, by), Demand::Disabled | Demand::QuickStop) => {
                self.stage = Stage::QuickStopped(Rearm::Free, by);
            }
            (Stage::Enabled, Demand::QuickStop) => {
                self.enter(Stage::QuickStopping(Power::towards(Goal::Stopped), now + STOP_DEADLINE), events);
            }
            // Out of quick stop the power goes at once, so the ramp is waited for.
            (Stage::QuickStopped(_, by), Demand::Disabled) if !self.still && now < by => {}
            (Stage::Enabling(..) | Stage::Enabled | Stage::QuickStopped(..), Demand::Disabled)
            | (Stage::Enabling(..) | Stage::Homing(..), Demand::QuickStop) => {
                self.switch_off(Rearm::Free, now, events);
            }
            (Stage::Faulted(FaultStep::Rest), _) if reset && self.state() == Some(State::Fault) => {
                self.stage = Stage::Faulted(FaultStep::Lower(request.fault_resets));
            }
            _ => {}
        }
    }

    /// Answers counters that ask for something which this stage does not do: an old request must not be carried out
    /// much later, when no one expects it.
    pub(super) fn acknowledge(&mut self, request: &AxisRequest, events: Events<'_>) {
        if !matches!(self.stage, Stage::Faulted(_) | Stage::Starting) {
            self.feedback.fault_resets = request.fault_resets;
        }
        if !matches!(self.stage, Stage::Homing(..) | Stage::Starting) && self.feedback.homings != request.homings {
            self.feedback.homings = request.homings;
            self.report(PortEventKind::HomingRefused, events);
        }
    }

    /// Powers the axis down whatever is going on.
    pub(super) fn power_down(&mut self, now: Nanos, events: Events<'_>) {
        if !self.is_at_rest() && !matches!(self.stage, Stage::Disabling { .. }) {
            self.switch_off(Rearm::Held, now, events);
        }
    }

    fn switch_off(&mut self, rearm: Rearm, now: Nanos, events: Events<'_>) {
        let power = Power::towards(Goal::Off);
        self.enter(Stage::Disabling { power, deadline: now + OFF_DEADLINE, rearm }, events);
    }

    fn check_deadline(&mut self, now: Nanos, events: Events<'_>) {
        let late = Failure::Deadline { statusword: self.feedback.statusword };
        match self.stage {
            Stage::Enabling(_, deadline) if now > deadline => {
                self.report(PortEventKind::EnableFailed(late), events);
                self.switch_off(Rearm::Held, now, events);
            }
            Stage::QuickStopping(_, deadline) if now > deadline => {
                self.report(PortEventKind::QuickStopFailed(late), events);
                self.switch_off(Rearm::Held, now, events);
            }
            Stage::Homing(_, deadline, _) if now > deadline => self.fail_homing(late, now, events),
            Stage::Faulted(FaultStep::Watch(count, deadline)) if now > deadline => self.end_reset(count, events),
            Stage::Disabling { deadline, rearm, .. } if now > deadline => {
                self.report(PortEventKind::StillOn { state: self.state() }, events);
                let power = Power::towards(Goal::Cut);
                self.stage = Stage::Disabling { power, deadline: now + OFF_DEADLINE, rearm };
            }
            _ => {}
        }
    }

    /// Takes the outcome of an exchange.
    pub(super) fn done(&mut self, ask: Ask, outcome: Result<Reply, LinkError>, now: Nanos, events: Events<'_>) {
        match outcome {
            Ok(reply) => {
                self.misses = 0;
                self.note(ask, &reply);
                if ask == Ask::Status && self.judge(now, events) {
                    return;
                }
                self.advance(ask, reply.raw, now, events);
            }
            Err(LinkError::Refused(code)) => {
                self.misses = 0;
                self.refused(ask, code, now, events);
            }
            Err(LinkError::Unanswered) => self.unanswered(now, events),
            Err(error @ (LinkError::Lost | LinkError::Broken(_))) => self.lose(error, events),
        }
    }

    /// Keeps what an exchange tells.
    fn note(&mut self, ask: Ask, reply: &Reply) {
        let feedback = &mut self.feedback;
        match ask {
            Ask::Position => {
                let position = i32::from_raw(reply.raw);
                self.still = feedback.position.0.abs_diff(position) <= STILL_COUNTS;
                feedback.position = Counts(position);
                feedback.stamp = reply.received;
                feedback.sequence = feedback.sequence.wrapping_add(1);
            }
            Ask::Status => {
                feedback.statusword = u16::from_raw(reply.raw);
                feedback.homed = Statusword(feedback.statusword).homed();
            }
            Ask::ErrorCode => feedback.error_code = u16::from_raw(reply.raw),
            Ask::Current => feedback.current_ma = i32::from_raw(reply.raw),
            Ask::Follow(request) => {
                self.reported.target = false;
                feedback.written = Some(WrittenTarget {
                    target: request.target,
                    stamp: reply.sent,
                    sequence: request.sequence,
                    command_stamp: request.command_stamp,
                    command_sequence: request.command_sequence,
                });
            }
            _ => {}
        }
    }

    /// Compares the state of the drive with the stage, and leaves the stage when they contradict each other: then the
    /// result is true.
    fn judge(&mut self, now: Nanos, events: Events<'_>) -> bool {
        let Some(state) = self.state() else { return false };
        match (self.stage, state) {
            (Stage::Faulted(_), state) if state.is_fault() => false,
            (Stage::Faulted(step), state) => {
                if let FaultStep::Watch(..) = step {
                    self.report(PortEventKind::FaultReset { cleared: true }, events);
                }
                self.settle(state, now, events);
                true
            }
            (_, state) if state.is_fault() => {
                self.enter(Stage::Faulted(FaultStep::Code), events);
                true
            }
            (Stage::Starting, state) => {
                self.settle(state, now, events);
                true
            }
            (Stage::Enabled, State::OperationEnabled)
            | (Stage::QuickStopped(..), State::QuickStopActive)
            | (Stage::Disabled(_), State::SwitchOnDisabled | State::Ready | State::NotReady) => false,
            (Stage::Homing(homing, ..), state) if homing.is_powered() && state != State::OperationEnabled => {
                self.report(PortEventKind::StateLost { state }, events);
                self.fail_homing(Failure::Interrupted, now, events);
                true
            }
            (Stage::Enabled, State::QuickStopActive) => {
                self.report(PortEventKind::StateLost { state }, events);
                self.enter(Stage::QuickStopped(Rearm::Held, now + STOP_DEADLINE), events);
                true
            }
            (Stage::Enabled | Stage::QuickStopped(..) | Stage::Disabled(_), state) => {
                self.report(PortEventKind::StateLost { state }, events);
                self.switch_off(Rearm::Held, now, events);
                true
            }
            _ => false,
        }
    }

    /// Goes to disabled, from wherever the drive was found.
    fn settle(&mut self, state: State, now: Nanos, events: Events<'_>) {
        if state.is_off() {
            self.enter(Stage::Disabled(Rearm::Held), events);
        } else {
            self.switch_off(Rearm::Held, now, events);
        }
    }

    /// Moves the present procedure on.
    fn advance(&mut self, ask: Ask, raw: u32, now: Nanos, events: Events<'_>) {
        let parts = self.drive.parts();
        match self.stage {
            Stage::Enabling(mut enabling, deadline) => {
                let progress = enabling.take(ask, raw, parts, &self.limits);
                self.stage = Stage::Enabling(enabling, deadline);
                self.end_enabling(progress, now, events);
            }
            Stage::Homing(mut homing, deadline, count) => {
                let progress = homing.take(ask, raw, parts);
                self.stage = Stage::Homing(homing, deadline, count);
                self.end_homing(progress, now, events);
            }
            Stage::QuickStopping(mut power, deadline) => {
                let reached = self.move_power(&mut power, ask);
                self.stage = Stage::QuickStopping(power, deadline);
                if reached {
                    self.enter(Stage::QuickStopped(Rearm::Free, now + STOP_DEADLINE), events);
                }
            }
            Stage::Disabling { mut power, deadline, rearm } => {
                let reached = self.move_power(&mut power, ask);
                self.stage = Stage::Disabling { power, deadline, rearm };
                if reached {
                    self.enter(Stage::Disabled(rearm), events);
                }
            }
            Stage::Faulted(step) => self.advance_fault(step, ask, now, events),
            Stage::Starting | Stage::Disabled(_) | Stage::Enabled | Stage::QuickStopped(..) | Stage::Lost => {}
        }
    }

    fn advance_fault(&mut self, step: FaultStep, ask: Ask, now: Nanos, events: Events<'_>) {
        let next = match (step, ask) {
            (FaultStep::Code, Ask::ErrorCode) => {
                let fault = self.drive.fault(self.feedback.error_code);
                self.report(PortEventKind::Fault(fault), events);
                FaultStep::Rest
            }
            (FaultStep::Lower(count), Ask::Control(Controlword::DISABLE_VOLTAGE)) => FaultStep::Raise(count),
            (FaultStep::Raise(count), Ask::Control(Controlword::FAULT_RESET)) => {
                FaultStep::Watch(count, now + RESET_DEADLINE)
            }
            (same, _) => same,
        };
        self.stage = Stage::Faulted(next);
    }

    /// The fault did not go.
    fn end_reset(&mut self, count: u32, events: Events<'_>) {
        self.report(PortEventKind::FaultReset { cleared: false }, events);
        self.feedback.fault_resets = count;
        self.stage = Stage::Faulted(FaultStep::Code);
    }

    fn move_power(&self, power: &mut Power, ask: Ask) -> bool {
        match (ask, self.state()) {
            (Ask::Status, Some(state)) => return power.look(state),
            (Ask::Control(_), _) => power.commanded(),
            _ => {}
        }
        false
    }

    fn end_enabling(&mut self, progress: Progress, now: Nanos, events: Events<'_>) {
        match progress {
            Progress::Going => {}
            Progress::Done => self.enter(Stage::Enabled, events),
            Progress::Failed(failure) => {
                self.report(PortEventKind::EnableFailed(failure), events);
                if failure == Failure::Restarted {
                    // Nothing of the configuration stands any more: the port thread brings it up again.
                    self.enter(Stage::Lost, events);
                } else {
                    self.switch_off(Rearm::Held, now, events);
                }
            }
        }
    }

    fn end_homing(&mut self, progress: Progress, now: Nanos, events: Events<'_>) {
        match progress {
            Progress::Going => {}
            Progress::Done => self.enter(Stage::Disabled(Rearm::Held), events),
            Progress::Failed(failure) => self.fail_homing(failure, now, events),
        }
    }

    fn fail_homing(&mut self, failure: Failure, now: Nanos, events: Events<'_>) {
        self.end_homing_with(Some(failure), events);
        self.switch_off(Rearm::Held, now, events);
    }

    fn refused(&mut self, ask: Ask, code: AbortCode, now: Nanos, events: Events<'_>) {
        let object = ask.object(self.drive.parts());
        match self.stage {
            Stage::Enabling(..) => {
                self.end_enabling(Progress::Failed(Failure::Refused { object, code }), now, events);
            }
            Stage::Homing(mut homing, deadline, count) => {
                let progress = homing.refused(object, code);
                self.stage = Stage::Homing(homing, deadline, count);
                self.end_homing(progress, now, events);
            }
            Stage::QuickStopping(..) => {
                self.report(PortEventKind::QuickStopFailed(Failure::Refused { object, code }), events);
                self.switch_off(Rearm::Held, now, events);
            }
            Stage::Faulted(FaultStep::Lower(count) | FaultStep::Raise(count)) => {
                self.report_refusal(object, code, events);
                self.end_reset(count, events);
            }
            _ => self.report_refusal(object, code, events),
        }
        self.cadence.look_at_status();
    }

    fn unanswered(&mut self, now: Nanos, events: Events<'_>) {
        self.misses += 1;
        if self.misses >= MISSES {
            return self.lose(LinkError::Unanswered, events);
        }
        if let Stage::Homing(homing, ..) = self.stage {
            self.end_homing(homing.unanswered(), now, events);
        }
    }

    /// The axis does not answer any more.
    pub(super) fn lose(&mut self, error: LinkError, events: Events<'_>) {
        if self.stage != Stage::Lost {
            self.report(PortEventKind::Lost(error), events);
            self.enter(Stage::Lost, events);
        }
    }

    /// The axis answers again, is the right one, off, and limited.
    pub(super) fn readmit(&mut self, events: Events<'_>) {
        self.misses = 0;
        self.reported = Reported::default();
        self.report(PortEventKind::Readmitted, events);
        self.enter(Stage::Starting, events);
    }

    /// The axis answers again, but is not usable.
    pub(super) fn refuse_admission(&mut self, fault: AxisFault, events: Events<'_>) {
        if self.reported.fault != Some(fault) {
            self.reported.fault = Some(fault);
            self.report(PortEventKind::NotReadmitted(fault), events);
        }
    }

    /// The one place where an axis changes its phase.
    fn enter(&mut self, stage: Stage, events: Events<'_>) {
        let from = self.stage.phase();
        match (self.stage, stage) {
            (Stage::Homing(..), Stage::Disabled(_)) => self.end_homing_with(None, events),
            (Stage::Homing(..), _) => self.end_homing_with(Some(Failure::Interrupted), events),
            (Stage::Faulted(step), _) => {
                self.feedback.fault_resets = step.count().unwrap_or(self.feedback.fault_resets);
            }
            _ => {}
        }
        if matches!(stage, Stage::Enabling(..) | Stage::Homing(..)) {
            // The drive is given another target, or another zero.
            self.feedback.written = None;
        }
        self.stage = stage;
        self.cadence = Cadence::default();
        self.reported.refusal = None;
        let (to, statusword) = (stage.phase(), self.feedback.statusword);
        self.feedback.phase = to;
        if from != to {
            self.report(PortEventKind::Phase { from, to, statusword }, events);
        }
    }

    /// Homing ends once, and is answered once.
    fn end_homing_with(&mut self, failure: Option<Failure>, events: Events<'_>) {
        if let Stage::Homing(_, _, count) = self.stage
            && self.feedback.homings != count
        {
            self.feedback.homings = count;
            self.report(PortEventKind::HomingEnded { failure }, events);
        }
    }

    fn state(&self) -> Option<State> {
        Statusword(self.feedback.statusword).state()
    }

    fn report_target(&mut self, target: Counts, events: Events<'_>) {
        let (min, max) = (Counts(*self.limits.start()), Counts(*self.limits.end()));
        if !self.reported.target {
            self.reported.target = true;
            self.report(PortEventKind::TargetRefused { target, min, max }, events);
        }
    }

    fn report_refusal(&mut self, object: Address, code: AbortCode, events: Events<'_>) {
        if self.reported.refusal != Some((object, code)) {
            self.reported.refusal = Some((object, code));
            self.report(PortEventKind::Refused { object, code }, events);
        }
    }

    /// Reports what happened.
    pub(super) fn report(&self, kind: PortEventKind, events: Events<'_>) {
        events(PortEvent { motor: self.motor, kind });
    }
}

fn extra_ask(extra: Extra) -> Ask {
    match extra {
        Extra::Status => Ask::Status,
        Extra::ErrorCode => Ask::ErrorCode,
        Extra::Current => Ask::Current,
    }
}
