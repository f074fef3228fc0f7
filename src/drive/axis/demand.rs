//! Input from the control loop: the demand starts transitions, deadlines abort them, and the state
//! gives the next transfer.

use std::ops::RangeInclusive;

use super::interface::{AxisRequest, Demand, Transfer};
use super::procedures::{EnablingStep, HomingStep, PowerSequence};
use super::schedule::{CommandNeed, LineUse, Need, Urgency};
use super::state_machine::{AxisState, AxisStateMachine, EventSink, FaultStep, STOP_EXCHANGES};
use crate::drive::cia402::{Controlword, DriveState, PowerGoal};
use crate::drive::event::{PortEventKind, TransitionError};
use crate::units::{Counts, Nanos};

const ENABLE_TIMEOUT: Nanos = Nanos::from_millis(2000);

/// Time for the ramp before the power is cut, and for the cut before the next attempt.
const OFF_TIMEOUT: Nanos = Nanos::from_millis(2000);

/// How long homing at the present position may take: a few transfers.
const HOMING_TIMEOUT: Nanos = Nanos::from_millis(10_000);

/// How long the search of a hard stop may take, at its low speed.
const STOP_SEARCH_TIMEOUT: Nanos = Nanos::from_millis(60_000);

impl AxisStateMachine {
    /// Takes a request in: before every exchange of the port, with whatever axis.
    pub(in crate::drive) fn take_request(
        &mut self,
        request: &AxisRequest,
        now: Nanos,
        events: EventSink<'_>,
    ) {
        self.check_deadline(now, events);
        if request.demand != Demand::Enabled {
            self.is_interlocked = false;
        }
        self.start_transition(request, now, events);
        self.acknowledge_counters(request, events);
        let is_out = !self.writable().contains(&request.target.0);
        if self.state == AxisState::Enabled && is_out {
            self.report_target(request.target, events);
        }
    }

    pub(in crate::drive) fn urgency(&self, request: &AxisRequest, line: &LineUse) -> Urgency {
        self.most_urgent(request, line).0
    }

    pub(in crate::drive) fn next_transfer(
        &mut self,
        request: &AxisRequest,
        now: Nanos,
        line: &mut LineUse,
        events: EventSink<'_>,
    ) -> Transfer {
        self.take_request(request, now, events);
        if let AxisState::QuickStopping(_, left) = &mut self.state {
            *left = left.saturating_sub(1);
        }
        let need = self.most_urgent(request, line);
        let transfer = need.1.unwrap_or_else(|| self.command(request));
        if matches!(transfer, Transfer::Setpoint(_)) {
            self.is_written = false;
            self.schedule.command_sequence = request.command_sequence;
        }
        self.schedule.count(need, transfer, line);
        transfer
    }

    fn most_urgent(&self, request: &AxisRequest, line: &LineUse) -> Need {
        if self.state.has_to_stop() {
            return (self.schedule.stop_urgency(line), None);
        }
        self.schedule.most_urgent(self.command_need(request), self.is_moving(request, line), line)
    }

    /// Value of the next setpoint or step; `None` if none is due.
    fn command_need(&self, request: &AxisRequest) -> Option<CommandNeed> {
        let transfer = self.state.transfer(self.object_map(), &self.plan);
        if self.state != AxisState::Enabled || self.trigger.transfer().is_some() {
            return transfer.or(self.trigger.transfer()).map(|_| CommandNeed::STEP);
        }
        // Not clamped: that would move the motor to a position that was never requested.
        if !self.writable().contains(&request.target.0) {
            return None;
        }
        let is_new = request.command_sequence != self.schedule.command_sequence;
        let change = match self.feedback.written {
            Some(written) => written.target.0.abs_diff(request.target.0),
            None => u32::MAX,
        };
        (change > 0 || !self.is_written).then_some(CommandNeed { change, is_new })
    }

    fn command(&self, request: &AxisRequest) -> Transfer {
        let step = self.state.transfer(self.object_map(), &self.plan);
        step.or(self.trigger.transfer()).unwrap_or(Transfer::Setpoint(*request))
    }

    /// It is on its way, in a transition, or not at rest yet.
    pub(in crate::drive) fn is_moving(&self, request: &AxisRequest, line: &LineUse) -> bool {
        match self.state {
            AxisState::Enabled => {
                !self.at_standstill
                    || self.schedule.has_commanded(line)
                    || self.command_need(request).is_some()
            }
            AxisState::QuickStopped(_) => !self.at_standstill,
            state => state.transfer(self.object_map(), &self.plan).is_some(),
        }
    }

    /// Every other axis of the port could be served since its last exchange.
    pub(in crate::drive) fn has_waited(&self, line: &LineUse) -> bool {
        self.schedule.has_waited(line)
    }

    /// Setpoints that may be written: within the limits, and at most the permitted following error
    /// from the setpoint that the drive has. Setpoints in between were not written.
    fn writable(&self) -> RangeInclusive<i32> {
        let (lowest, highest) = (*self.limits.start(), *self.limits.end());
        let far = self.max_unseen_motion;
        self.feedback.written.map_or(lowest..=highest, |written| {
            let at = written.target.0;
            lowest.max(at.saturating_sub_unsigned(far))
                ..=highest.min(at.saturating_add_unsigned(far))
        })
    }

    fn report_target(&mut self, target: Counts, events: EventSink<'_>) {
        let is_out = !self.limits.contains(&target.0);
        let range = if is_out { self.limits.clone() } else { self.writable() };
        let (min, max) = (Counts(*range.start()), Counts(*range.end()));
        if !std::mem::replace(&mut self.reported.target, true) {
            self.report(PortEventKind::TargetRefused { target, min, max }, events);
        }
    }

    fn start_transition(&mut self, request: &AxisRequest, now: Nanos, events: EventSink<'_>) {
        let homing = request.homings != self.feedback.homings;
        let reset = request.fault_resets != self.feedback.fault_resets;
        match (self.state, request.demand) {
            (AxisState::Disabled, Demand::Disabled | Demand::QuickStop) if homing => {
                let timeout = if self.plan.moves { STOP_SEARCH_TIMEOUT } else { HOMING_TIMEOUT };
                let (step, deadline) = (HomingStep::Position, now + timeout);
                self.enter(AxisState::Homing(step, deadline, request.homings), events);
            }
            (AxisState::Disabled | AxisState::QuickStopped(_), Demand::Enabled)
                if !self.is_interlocked =>
            {
                let (step, deadline) = (EnablingStep::LimitMin, now + ENABLE_TIMEOUT);
                self.enter(AxisState::Enabling(step, deadline), events);
            }
            (AxisState::Enabled, Demand::QuickStop) => {
                let power = PowerSequence::commanding(
                    PowerGoal::Stopped,
                    Controlword::QUICK_STOP,
                    DriveState::OperationEnabled,
                );
                self.enter(AxisState::QuickStopping(power, STOP_EXCHANGES), events);
            }
            // Disabling out of quick stop cuts the power at once, so the ramp must have ended.
            (AxisState::QuickStopped(deadline), Demand::Disabled)
                if !self.at_standstill && now < deadline => {}
            (
                AxisState::Enabling(..) | AxisState::Enabled | AxisState::QuickStopped(..),
                Demand::Disabled,
            )
            | (AxisState::Enabling(..) | AxisState::Homing(..), Demand::QuickStop) => {
                self.switch_off(now, events);
            }
            (AxisState::Faulted(FaultStep::WaitForOperator), _)
                if reset && self.drive_state() == Some(DriveState::Fault) =>
            {
                self.state = AxisState::Faulted(FaultStep::LowerBit(request.fault_resets));
            }
            _ => {}
        }
    }

    /// Acknowledges requests that this state does not carry out: an old request must not be carried
    /// out unexpectedly, much later.
    pub(in crate::drive) fn acknowledge_counters(
        &mut self,
        request: &AxisRequest,
        events: EventSink<'_>,
    ) {
        if !matches!(self.state, AxisState::Faulted(_) | AxisState::Starting) {
            self.feedback.fault_resets = request.fault_resets;
        }
        if !matches!(self.state, AxisState::Homing(..) | AxisState::Starting)
            && self.feedback.homings != request.homings
        {
            self.feedback.homings = request.homings;
            self.report(PortEventKind::HomingRefused, events);
        }
    }

    pub(in crate::drive) fn start_shutdown(&mut self, now: Nanos, events: EventSink<'_>) {
        if !self.is_shut_down() && !matches!(self.state, AxisState::Disabling(..)) {
            self.abort(now, events);
        }
    }

    /// Switches off because something failed.
    pub(super) fn abort(&mut self, now: Nanos, events: EventSink<'_>) {
        self.is_interlocked = true;
        self.switch_off(now, events);
    }

    fn switch_off(&mut self, now: Nanos, events: EventSink<'_>) {
        let power = PowerSequence::new(PowerGoal::Off);
        self.enter(AxisState::Disabling(power, now + OFF_TIMEOUT), events);
    }

    fn check_deadline(&mut self, now: Nanos, events: EventSink<'_>) {
        let error = TransitionError::Timeout(self.feedback.statusword);
        match self.state {
            AxisState::Enabling(_, deadline) if now > deadline => {
                self.report(PortEventKind::EnableFailed(error), events);
                self.abort(now, events);
            }
            AxisState::QuickStopping(_, 0) => {
                self.report(PortEventKind::QuickStopFailed(error), events);
                self.abort(now, events);
            }
            AxisState::Homing(_, deadline, _) if now > deadline => {
                self.abort_homing(error, now, events);
            }
            AxisState::Faulted(FaultStep::WaitForClear(count, deadline)) if now > deadline => {
                self.end_failed_reset(count, events);
            }
            AxisState::Disabling(_, deadline) if now > deadline => {
                let state = self.drive_state();
                self.report(PortEventKind::StillPowered(state), events);
                let power = PowerSequence::new(PowerGoal::Cut);
                self.state = AxisState::Disabling(power, now + OFF_TIMEOUT);
            }
            _ => {}
        }
    }
}
