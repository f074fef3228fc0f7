//! What an axis makes of the outcome of an exchange.

use super::ask::Ask;
use super::enabling::Enabling;
use super::power::Power;
use super::stage::{FaultStep, Stage};
use super::{Axis, Events, Progress, Rearm, Reply, STOP_DEADLINE};
use crate::drive::cia402::{Controlword, State, Statusword};
use crate::drive::error::{AxisFault, LinkError};
use crate::drive::event::{Failure, PortEventKind};
use crate::drive::family::Steering;
use crate::drive::object::Value;
use crate::drive::request::AbortCode;
use crate::drive::{AxisRequest, WrittenTarget};
use crate::units::{Counts, Nanos};

/// How long the drive may take to leave the fault state.
const RESET_DEADLINE: Nanos = Nanos::from_millis(500);

/// Exchanges in a row without an answer, on a line that is in step, that make an axis lost.
const MISSES: u32 = 3;

/// Distance between two positions in a row that counts as standing still: an encoder may waver by a
/// count.
const STILL_COUNTS: u32 = 1;

impl Axis {
    /// Takes the outcome of an exchange.
    pub(in crate::drive) fn done(
        &mut self,
        ask: Ask,
        outcome: Result<Reply, LinkError>,
        now: Nanos,
        events: Events<'_>,
    ) {
        let none = Reply {
            raw: 0,
            sent: now,
            received: now,
        };
        match outcome {
            // A history without an entry.
            Err(LinkError::Refused(_))
                if ask == Ask::ErrorCode && self.drive.parts().error_code_is_history =>
            {
                self.misses = 0;
                self.note(ask, &none);
                self.advance(ask, none.raw, now, events);
            }
            Ok(reply) => {
                self.misses = 0;
                self.note(ask, &reply);
                if ask == Ask::Status && self.judge(now, events) {
                    return;
                }
                self.advance(ask, reply.raw, now, events);
            }
            Err(LinkError::Refused(AbortCode::NO_NODE) | LinkError::Unanswered) => {
                self.unanswered(now, events)
            }
            Err(LinkError::Refused(code)) => {
                self.misses = 0;
                self.refused(ask, code, now, events);
            }
            Err(error @ (LinkError::Lost | LinkError::Broken(_))) => self.lose(error, events),
        }
    }

    /// Time passed without an answer: long enough for the drive to have been restarted, with
    /// another mode and another target than it was given. Its next steps must not build on what was
    /// true before.
    pub(in crate::drive) fn disturbed(&mut self, now: Nanos, events: Events<'_>) {
        match self.stage {
            Stage::Enabling(_, deadline) => {
                self.stage = Stage::Enabling(Enabling::LimitMin, deadline)
            }
            Stage::Homing(..) => self.fail_homing(Failure::Interrupted, now, events),
            _ => {}
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
                let homed = Statusword(feedback.statusword).homed();
                // A drive that has lost its zero has nothing to be doubted any more.
                self.displaced &= homed;
                feedback.homed = homed && !self.displaced;
            }
            Ask::ErrorCode => {
                let gone = self.drive.parts().error_code_is_history
                    && !self.state().is_some_and(State::is_fault);
                self.feedback.error_code = if gone { 0 } else { u16::from_raw(reply.raw) };
            }
            Ask::Current => feedback.current_ma = self.drive.parts().current.signed(reply.raw),
            Ask::Follow(request) => {
                self.reported.target = false;
                match self.drive.parts().steering {
                    Steering::Direct => self.note_written(&request, reply.sent),
                    Steering::Edge => self.steer.written(request),
                }
            }
            Ask::Take(request) => {
                self.steer.taken();
                self.note_written(&request, reply.sent);
            }
            Ask::Control(_) => self.steer.lowered(),
            Ask::Set(_) => self.unrestored = true,
            _ => {}
        }
    }

    fn note_written(&mut self, request: &AxisRequest, stamp: Nanos) {
        self.feedback.written = Some(WrittenTarget {
            target: request.target,
            stamp,
            sequence: request.sequence,
            command_stamp: request.command_stamp,
            command_sequence: request.command_sequence,
        });
    }

    /// Compares the state of the drive with the stage, and leaves the stage when they contradict
    /// each other: then the result is true.
    fn judge(&mut self, now: Nanos, events: Events<'_>) -> bool {
        let Some(state) = self.state() else {
            // What is not understood is brought up again from the start.
            self.refuse(
                AxisFault::UnknownState {
                    statusword: self.feedback.statusword,
                },
                events,
            );
            self.enter(Stage::Lost, events);
            return true;
        };
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
            | (Stage::Disabled, State::SwitchOnDisabled | State::Ready | State::NotReady) => false,
            (Stage::Homing(homing, ..), state)
                if homing.is_powered() && state != State::OperationEnabled =>
            {
                self.report(PortEventKind::StateLost { state }, events);
                self.fail_homing(Failure::Interrupted, now, events);
                true
            }
            (Stage::Enabled, State::QuickStopActive) => {
                self.report(PortEventKind::StateLost { state }, events);
                self.rearm = Rearm::Held;
                self.enter(Stage::QuickStopped(now + STOP_DEADLINE), events);
                true
            }
            (Stage::Enabled | Stage::QuickStopped(..) | Stage::Disabled, state) => {
                self.report(PortEventKind::StateLost { state }, events);
                self.give_up(now, events);
                true
            }
            _ => false,
        }
    }

    /// Goes to disabled, from wherever the drive was found.
    fn settle(&mut self, state: State, now: Nanos, events: Events<'_>) {
        if state.is_off() {
            self.settle_off(events);
        } else {
            self.give_up(now, events);
        }
    }

    /// The power is off. What homing changed and did not put back, the port thread does by bringing
    /// the axis up again.
    fn settle_off(&mut self, events: Events<'_>) {
        self.enter(
            if self.unrestored {
                Stage::Lost
            } else {
                Stage::Disabled
            },
            events,
        );
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
                let progress = homing.take(ask, raw, parts, &self.plan);
                self.stage = Stage::Homing(homing, deadline, count);
                self.end_homing(progress, now, events);
            }
            Stage::QuickStopping(mut power, deadline) => {
                let reached = self.move_power(&mut power, ask);
                self.stage = Stage::QuickStopping(power, deadline);
                if reached {
                    self.enter(Stage::QuickStopped(now + STOP_DEADLINE), events);
                }
            }
            Stage::Disabling(mut power, deadline) => {
                let reached = self.move_power(&mut power, ask);
                self.stage = Stage::Disabling(power, deadline);
                if reached {
                    self.settle_off(events);
                }
            }
            Stage::Faulted(step) => self.advance_fault(step, ask, now, events),
            Stage::Starting
            | Stage::Disabled
            | Stage::Enabled
            | Stage::QuickStopped(..)
            | Stage::Lost => {}
        }
    }

    fn advance_fault(&mut self, step: FaultStep, ask: Ask, now: Nanos, events: Events<'_>) {
        let next = match (step, ask) {
            (FaultStep::Code, Ask::ErrorCode) => {
                let fault = self.drive.fault(self.feedback.error_code);
                self.report(PortEventKind::Fault(fault), events);
                FaultStep::Rest
            }
            (FaultStep::Lower(count), Ask::Control(Controlword::DISABLE_VOLTAGE)) => {
                FaultStep::Raise(count)
            }
            (FaultStep::Raise(count), Ask::Control(Controlword::FAULT_RESET)) => {
                FaultStep::Watch(count, now + RESET_DEADLINE)
            }
            (same, _) => same,
        };
        self.stage = Stage::Faulted(next);
    }

    /// The fault did not go.
    pub(super) fn end_reset(&mut self, count: u32, events: Events<'_>) {
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
                    // Nothing of the configuration stands any more: the port thread brings it up
                    // again.
                    self.enter(Stage::Lost, events);
                } else {
                    self.give_up(now, events);
                }
            }
        }
    }

    fn end_homing(&mut self, progress: Progress, now: Nanos, events: Events<'_>) {
        match progress {
            Progress::Going => {}
            Progress::Done => {
                self.unrestored = false;
                self.enter(Stage::Disabled, events);
            }
            Progress::Failed(failure) => self.fail_homing(failure, now, events),
        }
    }

    pub(super) fn fail_homing(&mut self, failure: Failure, now: Nanos, events: Events<'_>) {
        self.end_homing_with(Some(failure), events);
        self.give_up(now, events);
    }

    fn refused(&mut self, ask: Ask, code: AbortCode, now: Nanos, events: Events<'_>) {
        self.steer.unanswered();
        let object = ask.object(self.drive.parts());
        match self.stage {
            Stage::Enabling(..) => {
                self.end_enabling(
                    Progress::Failed(Failure::Refused { object, code }),
                    now,
                    events,
                );
            }
            Stage::Homing(mut homing, deadline, count) => {
                let progress = homing.refused(object, code);
                self.stage = Stage::Homing(homing, deadline, count);
                self.end_homing(progress, now, events);
            }
            Stage::QuickStopping(..) => {
                self.report(
                    PortEventKind::QuickStopFailed(Failure::Refused { object, code }),
                    events,
                );
                self.give_up(now, events);
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
        self.steer.unanswered();
        if self.misses >= MISSES {
            return self.lose(LinkError::Unanswered, events);
        }
        if let Stage::Homing(homing, ..) = self.stage {
            self.end_homing(homing.unanswered(), now, events);
        }
    }
}
