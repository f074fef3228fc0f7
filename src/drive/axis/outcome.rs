//! Input from the drive: the outcome of a transfer updates the feedback and ends transitions.

use super::interface::{AxisRequest, Transfer, WrittenTarget};
use super::procedures::{EnablingStep, ProcedureStatus};
use super::schedule::TriggerState;
use super::state_machine::{AxisState, AxisStateMachine, EventSink, FaultStep, STOP_TIMEOUT};
use crate::drive::cia402::{Controlword, DriveState, Statusword};
use crate::drive::error::{AxisError, LinkError, UnexpectedReply};
use crate::drive::event::{PortEventKind, TransitionError};
use crate::drive::family::SetpointTrigger;
use crate::drive::link::TimedReply;
use crate::drive::object::{AbortCode, Value};
use crate::robot::AxisPhase;
use crate::units::{Counts, Nanos};

/// How long the drive may take to leave the fault state.
const RESET_TIMEOUT: Nanos = Nanos::from_millis(500);

/// An axis is lost after this many transfers in a row without an answer, on a line in sync.
const MAX_UNANSWERED: u32 = 3;

/// Two positions in a row this close count as standstill: an encoder may toggle by a count.
const STANDSTILL_COUNTS: u32 = 1;

impl AxisStateMachine {
    /// Handles the outcome of a transfer. The value of a write is 0.
    pub(in crate::drive) fn handle_outcome(
        &mut self,
        transfer: Transfer,
        outcome: Result<TimedReply<u32>, LinkError>,
        now: Nanos,
        events: EventSink<'_>,
    ) {
        // A write without a reply may have arrived.
        let is_refused = matches!(outcome, Err(LinkError::Refused(it)) if it != AbortCode::NO_NODE);
        self.settings_changed |= matches!(transfer, Transfer::Set(_)) && !is_refused;
        match outcome {
            Ok(reply) => {
                self.unanswered = 0;
                self.update_feedback(transfer, &reply, events);
                if transfer != Transfer::Status || !self.check_drive_state(now, events) {
                    self.advance(transfer, reply.value, now, events);
                }
            }
            // The gateway waited for the drive: as after a timeout.
            Err(LinkError::Refused(AbortCode::NO_NODE)) => {
                self.schedule.repeat(transfer);
                self.handle_timeout(now, events);
                self.handle_unanswered(UnexpectedReply::default(), now, events);
            }
            // An empty error history, or a drive that does not report the code.
            Err(LinkError::Refused(code))
                if transfer == Transfer::ErrorCode
                    && (self.object_map().error_code_is_history || code.is_missing()) =>
            {
                let none = TimedReply { value: 0, sent: now, received: now };
                self.handle_outcome(transfer, Ok(none), now, events);
            }
            Err(LinkError::Unanswered(unexpected)) => {
                self.schedule.repeat(transfer);
                self.handle_unanswered(unexpected, now, events);
            }
            // The watchdog may have stopped the drive: as after a time-out.
            Err(LinkError::NotOurTurn) => {
                self.schedule.repeat(transfer);
                self.distrust_state(now, events);
                self.trigger.handle_failure();
                self.handle_timeout(now, events);
            }
            Err(LinkError::Refused(code)) => {
                self.unanswered = 0;
                self.handle_refusal(transfer, code, now, events);
            }
            Err(error @ (LinkError::Lost(_) | LinkError::Broken(_))) => {
                self.set_lost(error, events)
            }
        }
    }

    /// A request timed out: long enough for a restart of the drive, with another mode and another
    /// target than before. The next steps must not rely on earlier ones.
    pub(in crate::drive) fn handle_timeout(&mut self, now: Nanos, events: EventSink<'_>) {
        match self.state {
            AxisState::Enabling(_, deadline) => {
                self.state = AxisState::Enabling(EnablingStep::LimitMin, deadline);
            }
            AxisState::Homing(..) => self.abort_homing(TransitionError::Interrupted, now, events),
            _ => {}
        }
    }

    /// The watchdog has the line. The state is read before any other step: a controlword could end
    /// its stop. What would give the drive power ends here.
    pub(in crate::drive) fn distrust_state(&mut self, now: Nanos, events: EventSink<'_>) {
        self.schedule.repeat(Transfer::Status);
        let error = TransitionError::Stopped;
        match self.state {
            AxisState::Enabling(..) => {
                self.handle_enabling(ProcedureStatus::Failed(error), now, events);
            }
            AxisState::Homing(..) => self.abort_homing(error, now, events),
            _ => {}
        }
    }

    fn update_feedback(
        &mut self,
        transfer: Transfer,
        reply: &TimedReply<u32>,
        events: EventSink<'_>,
    ) {
        let map = self.object_map();
        if transfer == Transfer::Position {
            self.check_jump(Counts(i32::from_raw(reply.value)), reply, events);
        }
        let feedback = &mut self.feedback;
        match transfer {
            Transfer::Position => {
                let position = i32::from_raw(reply.value);
                self.at_standstill = feedback.position.0.abs_diff(position) <= STANDSTILL_COUNTS;
                feedback.position = Counts(position);
                feedback.stamp = reply.received;
                feedback.sequence = feedback.sequence.wrapping_add(1);
            }
            Transfer::Status => {
                let statusword = Statusword(u16::from_raw(reply.value));
                feedback.statusword = statusword.0;
                // A drive that lost its zero has nothing left to distrust.
                self.position_mismatch &= statusword.homed();
                feedback.homed = statusword.homed() && !self.position_mismatch;
            }
            Transfer::ErrorCode => {
                let state = Statusword(feedback.statusword).state();
                let is_old = map.error_code_is_history && !state.is_some_and(DriveState::is_fault);
                feedback.error_code = if is_old { 0 } else { u16::from_raw(reply.value) };
            }
            Transfer::Current => {
                feedback.current_ma = map.current.signed(reply.value);
                feedback.current_stamp = reply.received;
            }
            Transfer::Setpoint(request) => {
                self.reported.target = false;
                match map.setpoint_trigger {
                    SetpointTrigger::Write => self.set_written(&request, reply.sent),
                    SetpointTrigger::Edge => self.trigger = TriggerState::Written(request),
                }
            }
            Transfer::TriggerSetpoint(request) => {
                self.trigger = TriggerState::Raised;
                self.set_written(&request, reply.sent);
            }
            Transfer::Control(_) => self.trigger = TriggerState::Ready,
            _ => {}
        }
    }

    fn set_written(&mut self, request: &AxisRequest, stamp: Nanos) {
        self.is_written = true;
        self.feedback.written = Some(WrittenTarget {
            target: request.target,
            stamp,
            sequence: request.sequence,
            command_stamp: request.command_stamp,
            command_sequence: request.command_sequence,
        });
    }

    /// Leaves the present state if the state of the drive contradicts it: then the result is true.
    fn check_drive_state(&mut self, now: Nanos, events: EventSink<'_>) -> bool {
        let Some(drive) = self.drive_state() else {
            // An unknown state: the axis is brought up again from the start.
            let statusword = self.feedback.statusword;
            self.report_unusable(AxisError::UnknownState(statusword), events);
            self.enter(AxisState::Lost, events);
            return true;
        };
        match self.state {
            AxisState::Faulted(_) if drive.is_fault() => return false,
            _ if drive.is_fault() => self.enter(AxisState::Faulted(FaultStep::ReadCode), events),
            AxisState::Faulted(step) => {
                if let FaultStep::WaitForClear(..) = step {
                    self.report(PortEventKind::FaultReset(true), events);
                }
                self.go_to_disabled(drive, now, events);
            }
            AxisState::Starting => self.go_to_disabled(drive, now, events),
            AxisState::Homing(step, ..)
                if step.is_powered() && drive != DriveState::OperationEnabled =>
            {
                self.report(PortEventKind::UnexpectedState(drive), events);
                self.abort_homing(TransitionError::Interrupted, now, events);
            }
            AxisState::Enabled if drive == DriveState::OperationEnabled => return false,
            AxisState::QuickStopped(..) if drive == DriveState::QuickStopActive => return false,
            AxisState::Disabled if drive.is_off() || drive == DriveState::NotReady => return false,
            AxisState::Enabled if drive == DriveState::QuickStopActive => {
                self.report(PortEventKind::UnexpectedState(drive), events);
                self.is_interlocked = true;
                self.enter(AxisState::QuickStopped(now + STOP_TIMEOUT), events);
            }
            AxisState::Enabled | AxisState::QuickStopped(..) | AxisState::Disabled => {
                self.report(PortEventKind::UnexpectedState(drive), events);
                self.abort(now, events);
            }
            _ => return false,
        }
        true
    }

    fn go_to_disabled(&mut self, drive: DriveState, now: Nanos, events: EventSink<'_>) {
        if drive.is_off() {
            self.enter_off(events);
        } else {
            self.abort(now, events);
        }
    }

    /// The power is off. Settings that homing changed and did not restore are restored by the port
    /// thread: it brings a lost axis up again. One that answers is not lost for the controller.
    fn enter_off(&mut self, events: EventSink<'_>) {
        if self.settings_changed {
            self.enter(AxisState::Lost, events);
            self.feedback.phase = AxisPhase::Starting;
        } else {
            self.enter(AxisState::Disabled, events);
        }
    }

    fn advance(&mut self, transfer: Transfer, raw: u32, now: Nanos, events: EventSink<'_>) {
        let map = self.object_map();
        match &mut self.state {
            AxisState::Enabling(step, _) => {
                let status = step.advance(transfer, raw, map, &self.limits);
                self.handle_enabling(status, now, events);
            }
            AxisState::Homing(step, ..) => {
                let status = step.advance(transfer, raw, map, &self.plan);
                self.handle_homing(status, now, events);
            }
            AxisState::QuickStopping(power, _) => {
                if power.advance(transfer, raw) {
                    self.enter(AxisState::QuickStopped(now + STOP_TIMEOUT), events);
                }
            }
            AxisState::Disabling(power, _) => {
                if power.advance(transfer, raw) {
                    self.enter_off(events);
                }
            }
            AxisState::Faulted(step) => match (*step, transfer) {
                (FaultStep::ReadCode, Transfer::ErrorCode) => {
                    *step = FaultStep::WaitForOperator;
                    let fault = self.family.fault(self.feedback.error_code);
                    // Whatever its bit says, until it is homed.
                    self.position_mismatch |= fault.clears_position;
                    self.feedback.homed &= !fault.clears_position;
                    self.report(PortEventKind::Fault(fault), events);
                }
                (FaultStep::LowerBit(count), Transfer::Control(Controlword::DISABLE_VOLTAGE)) => {
                    *step = FaultStep::RaiseBit(count);
                }
                (FaultStep::RaiseBit(count), Transfer::Control(Controlword::FAULT_RESET)) => {
                    *step = FaultStep::WaitForClear(count, now + RESET_TIMEOUT);
                }
                _ => {}
            },
            AxisState::Starting
            | AxisState::Disabled
            | AxisState::Enabled
            | AxisState::QuickStopped(..)
            | AxisState::Lost => {}
        }
    }

    pub(super) fn end_failed_reset(&mut self, count: u32, events: EventSink<'_>) {
        self.report(PortEventKind::FaultReset(false), events);
        self.feedback.fault_resets = count;
        self.state = AxisState::Faulted(FaultStep::ReadCode);
    }

    fn handle_enabling(&mut self, status: ProcedureStatus, now: Nanos, events: EventSink<'_>) {
        match status {
            ProcedureStatus::Running => {}
            ProcedureStatus::Done => self.enter(AxisState::Enabled, events),
            ProcedureStatus::Failed(error) => {
                self.report(PortEventKind::EnableFailed(error), events);
                if error == TransitionError::Restarted {
                    // The configuration is gone: the port thread brings the axis up again.
                    self.enter(AxisState::Lost, events);
                } else {
                    self.abort(now, events);
                }
            }
        }
    }

    fn handle_homing(&mut self, status: ProcedureStatus, now: Nanos, events: EventSink<'_>) {
        match status {
            ProcedureStatus::Running => {}
            ProcedureStatus::Done => {
                self.settings_changed = false;
                self.enter(AxisState::Disabled, events);
            }
            ProcedureStatus::Failed(error) => self.abort_homing(error, now, events),
        }
    }

    pub(super) fn abort_homing(
        &mut self,
        error: TransitionError,
        now: Nanos,
        events: EventSink<'_>,
    ) {
        self.report_homing_end(Some(error), events);
        self.abort(now, events);
    }

    fn handle_refusal(
        &mut self,
        transfer: Transfer,
        code: AbortCode,
        now: Nanos,
        events: EventSink<'_>,
    ) {
        self.trigger.handle_failure();
        let object = transfer.object(self.object_map());
        let error = TransitionError::Refused { object, code };
        match &mut self.state {
            AxisState::Enabling(..) => {
                self.handle_enabling(ProcedureStatus::Failed(error), now, events);
            }
            AxisState::Homing(step, ..) => {
                let status = step.handle_refusal(object, code);
                self.handle_homing(status, now, events);
            }
            AxisState::QuickStopping(..) => {
                self.report(PortEventKind::QuickStopFailed(error), events);
                self.abort(now, events);
            }
            AxisState::Faulted(FaultStep::LowerBit(count) | FaultStep::RaiseBit(count)) => {
                let count = *count;
                self.report_refusal(object, code, events);
                self.end_failed_reset(count, events);
            }
            _ => self.report_refusal(object, code, events),
        }
        self.schedule.repeat(Transfer::Status);
    }

    fn handle_unanswered(
        &mut self,
        unexpected: UnexpectedReply,
        now: Nanos,
        events: EventSink<'_>,
    ) {
        self.unanswered += 1;
        self.trigger.handle_failure();
        if self.unanswered >= MAX_UNANSWERED {
            self.set_lost(LinkError::Unanswered(unexpected), events);
        } else if let AxisState::Homing(step, ..) = self.state {
            self.handle_homing(step.handle_timeout(), now, events);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{AxisConfig, Family};
    use crate::drive::family_selection::family_of_line;

    #[test]
    fn silence_of_a_node_is_no_error_code() {
        let config = AxisConfig::new(0, 1, [Counts(-100), Counts(100)]);
        let mut axis = AxisStateMachine::new(&config, family_of_line(Family::Epos2));
        axis.state = AxisState::Faulted(FaultStep::ReadCode);
        let (silence, empty) = (AbortCode::NO_NODE, AbortCode(0x0602_0000));
        for (code, step) in [(silence, FaultStep::ReadCode), (empty, FaultStep::WaitForOperator)] {
            let refused = Err(LinkError::Refused(code));
            axis.handle_outcome(Transfer::ErrorCode, refused, Nanos::ZERO, &mut |_| {});
            assert_eq!(axis.state, AxisState::Faulted(step));
        }
    }
}
