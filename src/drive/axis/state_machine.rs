//! The states of an axis, and entering a state.

use std::ops::RangeInclusive;

use super::interface::{AxisFeedback, AxisRequest, Demand, Transfer};
use super::procedures::{EnablingStep, HomingStep, PowerSequence};
use super::schedule::{Schedule, TriggerState};
use crate::config::AxisConfig;
use crate::drive::cia402::{Controlword, DriveState, Statusword};
use crate::drive::error::{AxisError, LinkError};
use crate::drive::event::{PortEvent, PortEventKind, TransitionError};
use crate::drive::family::{DriveFamily, HomingPlan, ObjectMap};
use crate::drive::link::{LinkCounters, TimedReply};
use crate::drive::object::{AbortCode, Address};
use crate::robot::{AxisPhase, DrivePower};
use crate::units::{Counts, Nanos};

/// Exchanges within which a drive has to report quick stop. Not a time: while a line waits for
/// another node, no request is sent.
pub(super) const STOP_EXCHANGES: u32 = 100;

/// How long the drive may take to come to a standstill in quick stop.
pub(super) const STOP_TIMEOUT: Nanos = Nanos::from_millis(1000);

/// Receiver of events.
pub(in crate::drive) type EventSink<'a> = &'a mut dyn FnMut(PortEvent);

/// Counts per turn of the finest encoder of such motors, in quadrature.
const FINEST_ENCODER: f64 = 4096.0;

/// Tolerated jump of a position, counts: the sampling instant of the drive is unknown.
const POSITION_JITTER: f64 = 32.0;

/// Maximum motion of a resting motor without power between two readings: turned by hand.
const TURNED_BY_HAND: f64 = 20.0;

/// The states, finer than the phases that the control loop sees. Instants are deadlines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum AxisState {
    /// Configured; the state of the drive was not read yet.
    Starting,
    Disabled,
    Enabling(EnablingStep, Nanos),
    Enabled,
    /// Quick stop was commanded; the drive does not report it yet. Exchanges that are left for it.
    QuickStopping(PowerSequence, u32),
    /// Quick stop is active. By the deadline the motor is at standstill, or never will be.
    QuickStopped(Nanos),
    /// Searching the home position; the number is the request that is being carried out.
    Homing(HomingStep, Nanos, u32),
    /// Being disabled; at the deadline the power is cut instead.
    Disabling(PowerSequence, Nanos),
    Faulted(FaultStep),
    Lost,
}

/// Steps of a fault. The number is the fault reset that is being carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FaultStep {
    ReadCode,
    WaitForOperator,
    /// Lower the reset bit: only its rising edge counts.
    LowerBit(u32),
    RaiseBit(u32),
    WaitForClear(u32, Nanos),
}

impl AxisState {
    /// The next transfer stops the drive: it goes before everything that is only read.
    pub(super) fn has_to_stop(self) -> bool {
        match self {
            Self::QuickStopping(power, _) | Self::Disabling(power, _) => power.has_to_command(),
            _ => false,
        }
    }

    pub(super) fn phase(self) -> AxisPhase {
        match self {
            Self::Starting => AxisPhase::Starting,
            Self::Disabled => AxisPhase::Disabled,
            Self::Enabling(..) => AxisPhase::Enabling,
            // Until the drive reports quick stop it may still be following.
            Self::Enabled | Self::QuickStopping(..) => AxisPhase::Enabled,
            Self::QuickStopped(..) => AxisPhase::QuickStopped,
            Self::Homing(..) => AxisPhase::Homing,
            Self::Disabling(..) => AxisPhase::Disabling,
            Self::Faulted(_) => AxisPhase::Faulted,
            Self::Lost => AxisPhase::Lost,
        }
    }

    /// The transfer that the state needs to continue; `None` if it only monitors.
    pub(super) fn transfer(self, map: &ObjectMap, plan: &HomingPlan) -> Option<Transfer> {
        Some(match self {
            Self::Enabling(step, _) => step.transfer(map),
            Self::Homing(step, ..) => step.transfer(map, plan),
            Self::QuickStopping(power, _) | Self::Disabling(power, _) => power.transfer(),
            Self::Faulted(FaultStep::ReadCode) => Transfer::ErrorCode,
            Self::Faulted(FaultStep::LowerBit(_)) => {
                Transfer::Control(Controlword::DISABLE_VOLTAGE)
            }
            Self::Faulted(FaultStep::RaiseBit(_)) => Transfer::Control(Controlword::FAULT_RESET),
            Self::Faulted(FaultStep::WaitForClear(..)) | Self::Starting => Transfer::Status,
            Self::Faulted(FaultStep::WaitForOperator)
            | Self::Disabled
            | Self::Enabled
            | Self::QuickStopped(..)
            | Self::Lost => return None,
        })
    }
}

#[derive(Debug)]
pub(in crate::drive) struct AxisStateMachine {
    motor: usize,
    pub(super) limits: RangeInclusive<i32>,
    /// Largest change of a position that is not read, counts: the distance to the last setpoint.
    pub(super) max_unseen_motion: u32,
    /// The fastest that the motor may turn, counts/s.
    max_speed: f64,
    /// Time of the last position request; `None` after an operation that moves the zero.
    position_requested: Option<Nanos>,
    pub(super) family: &'static dyn DriveFamily,
    pub(super) plan: HomingPlan,
    pub(super) state: AxisState,
    /// A demand for enabled is not carried out until it was something else since the last failure.
    pub(super) is_interlocked: bool,
    pub(super) schedule: Schedule,
    pub(super) trigger: TriggerState,
    /// The last setpoint that was sent is known to have arrived.
    pub(super) is_written: bool,
    pub(super) feedback: AxisFeedback,
    /// The position changed while it was not read: the homed bit of the drive is not trusted until
    /// the axis is homed.
    pub(super) position_mismatch: bool,
    /// Homing changed settings that are not restored yet.
    pub(super) settings_changed: bool,
    pub(super) at_standstill: bool,
    /// Transfers in a row without an answer.
    pub(super) unanswered: u32,
    pub(super) reported: Reported,
}

/// The last reports, so that a repeat is not reported again.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Reported {
    pub(super) target: bool,
    refusal: Option<(Address, AbortCode)>,
    error: Option<AxisError>,
}

impl AxisStateMachine {
    pub(in crate::drive) fn new(config: &AxisConfig, family: &'static dyn DriveFamily) -> Self {
        Self {
            motor: config.motor,
            limits: config.position_min_counts.0..=config.position_max_counts.0,
            max_unseen_motion: config.following_error_counts,
            max_speed: f64::from(config.motor_speed_rpm) / 60.0 * FINEST_ENCODER,
            position_requested: None,
            family,
            plan: family.homing(config),
            state: AxisState::Starting,
            is_interlocked: true,
            schedule: Schedule::default(),
            trigger: TriggerState::default(),
            is_written: false,
            position_mismatch: false,
            settings_changed: false,
            feedback: AxisFeedback::default(),
            at_standstill: false,
            unanswered: 0,
            reported: Reported::default(),
        }
    }

    /// Leaves out what the drive does not have.
    pub(in crate::drive) fn leave_out(&mut self, objects: &[Address]) {
        self.plan.leave_out(objects);
    }

    pub(in crate::drive) fn object_map(&self) -> &'static ObjectMap {
        self.family.object_map()
    }

    pub(in crate::drive) fn feedback(&self, counters: LinkCounters) -> AxisFeedback {
        AxisFeedback { counters, ..self.feedback }
    }

    pub(in crate::drive) fn is_lost(&self) -> bool {
        self.state == AxisState::Lost
    }

    /// The last exchange was answered.
    pub(in crate::drive) fn answers(&self) -> bool {
        !self.is_lost() && self.unanswered == 0
    }

    /// Whether a stop has to be sent to the drive, or is not reported by it yet.
    pub(in crate::drive) fn is_stop_due(&self, request: &AxisRequest) -> bool {
        match self.state {
            AxisState::QuickStopping(..) => true,
            AxisState::Disabling(power, _) => power.has_to_command(),
            AxisState::Enabled | AxisState::Enabling(..) => request.demand != Demand::Enabled,
            AxisState::Homing(..) => request.demand == Demand::QuickStop,
            _ => false,
        }
    }

    pub(in crate::drive) fn disable_request(&self) -> AxisRequest {
        AxisRequest {
            demand: Demand::Disabled,
            fault_resets: self.feedback.fault_resets,
            homings: self.feedback.homings,
            ..AxisRequest::default()
        }
    }

    /// Nothing is left to switch off, or it is impossible.
    pub(in crate::drive) fn is_shut_down(&self) -> bool {
        matches!(self.state, AxisState::Disabled | AxisState::Faulted(_) | AxisState::Lost)
    }

    /// Power of the drive as known if it answers now.
    pub(in crate::drive) fn power(&self) -> DrivePower {
        match self.feedback.phase {
            // It was switched off, and its settings were not restored yet: see `enter_off`.
            AxisPhase::Starting if self.is_lost() && self.unanswered == 0 => DrivePower::Off,
            _ if self.answers() => self.feedback.power(Nanos::ZERO),
            _ => DrivePower::NotKnown,
        }
    }

    pub(super) fn drive_state(&self) -> Option<DriveState> {
        Statusword(self.feedback.statusword).state()
    }

    pub(in crate::drive) fn set_lost(&mut self, error: LinkError, events: EventSink<'_>) {
        if !self.is_lost() {
            self.report(PortEventKind::Lost(error), events);
            self.enter(AxisState::Lost, events);
        }
    }

    /// Its settings are those of the configuration, so it may keep its power.
    pub(in crate::drive) fn may_hold(&self) -> bool {
        !self.settings_changed && self.feedback.stamp > Nanos::ZERO
    }

    /// The axis answers again and is the configured one: it `holds` by quick stop, or is off and
    /// limited. `position` is the present position.
    pub(in crate::drive) fn reconnect(
        &mut self,
        position: i32,
        holds: bool,
        now: Nanos,
        events: EventSink<'_>,
    ) {
        if self.feedback.stamp > Nanos::ZERO {
            self.compare_position(Some(self.feedback.position), Counts(position), events);
        }
        self.unanswered = 0;
        self.settings_changed = false;
        self.reported = Reported::default();
        self.report(PortEventKind::Reconnected(holds), events);
        let stopped = AxisState::QuickStopped(now + STOP_TIMEOUT);
        self.enter(if holds { stopped } else { AxisState::Starting }, events);
    }

    /// Compares the present position with the last known one. The axis counts as not homed if the
    /// difference exceeds the motor's own possible motion: something else moved it, or the encoder
    /// counts from a different zero.
    pub(in crate::drive) fn compare_position(
        &mut self,
        before: Option<Counts>,
        after: Counts,
        events: EventSink<'_>,
    ) {
        if before.is_none_or(|before| before.0.abs_diff(after.0) > self.max_unseen_motion) {
            self.position_mismatch = true;
            self.feedback.homed = false;
            self.report(PortEventKind::PositionMismatch { before, after }, events);
        }
    }

    /// Whether the position has changed by more than the motor can turn: the encoder has lost or
    /// gained counts, and the axis counts as not homed.
    pub(super) fn check_jump(
        &mut self,
        position: Counts,
        reply: &TimedReply<u32>,
        events: EventSink<'_>,
    ) {
        let before = self.feedback.position;
        // While the zero moves, nothing is known of the way.
        let is_moved = matches!(self.state, AxisState::Homing(..));
        let Some(requested) = self.position_requested.replace(reply.sent).filter(|_| !is_moved)
        else {
            return;
        };
        let is_still = self.state == AxisState::Disabled && self.at_standstill;
        let most = if is_still {
            TURNED_BY_HAND
        } else {
            POSITION_JITTER + self.max_speed * reply.received.duration_since(requested).as_seconds()
        };
        if self.feedback.homed && f64::from(before.0.abs_diff(position.0)) > most {
            self.position_mismatch = true;
            self.feedback.homed = false;
            let kind = PortEventKind::PositionMismatch { before: Some(before), after: position };
            self.report(kind, events);
        }
    }

    /// The position to save for the next start: that of an axis that is off and homed.
    pub(in crate::drive) fn position_to_save(&self) -> Option<Counts> {
        (self.state == AxisState::Disabled && self.feedback.homed).then_some(self.feedback.position)
    }

    /// The axis answers, but is not usable. Reported once.
    pub(in crate::drive) fn report_unusable(&mut self, error: AxisError, events: EventSink<'_>) {
        if self.reported.error.replace(error) != Some(error) {
            self.report(PortEventKind::Unusable(error), events);
        }
    }

    /// The only function that changes the phase of an axis.
    pub(super) fn enter(&mut self, state: AxisState, events: EventSink<'_>) {
        let from = self.state.phase();
        match (self.state, state) {
            (AxisState::Homing(..), AxisState::Disabled) => self.report_homing_end(None, events),
            (AxisState::Homing(..), _) => {
                self.report_homing_end(Some(TransitionError::Interrupted), events);
            }
            (
                AxisState::Faulted(
                    FaultStep::LowerBit(count)
                    | FaultStep::RaiseBit(count)
                    | FaultStep::WaitForClear(count, _),
                ),
                _,
            ) => self.feedback.fault_resets = count,
            _ => {}
        }
        match state {
            AxisState::Starting | AxisState::Faulted(_) | AxisState::Lost => {
                self.is_interlocked = true;
            }
            // The drive gets another target, or another zero.
            AxisState::Enabling(..) | AxisState::Homing(..) => self.feedback.written = None,
            _ => {}
        }
        let moves_zero = |state| matches!(state, AxisState::Homing(..) | AxisState::Lost);
        if moves_zero(self.state) || moves_zero(state) {
            self.position_requested = None;
        }
        self.at_standstill = false;
        self.state = state;
        self.trigger = TriggerState::default();
        self.reported.refusal = None;
        let (to, statusword) = (state.phase(), self.feedback.statusword);
        self.feedback.phase = to;
        if from != to {
            self.report(PortEventKind::Phase { from, to, statusword }, events);
        }
    }

    /// Homing ends once, and is reported once.
    pub(super) fn report_homing_end(
        &mut self,
        error: Option<TransitionError>,
        events: EventSink<'_>,
    ) {
        if let AxisState::Homing(_, _, count) = self.state
            && self.feedback.homings != count
        {
            self.feedback.homings = count;
            self.position_mismatch &= error.is_some();
            self.report(PortEventKind::HomingEnded(error), events);
        }
    }

    pub(super) fn report_refusal(
        &mut self,
        object: Address,
        code: AbortCode,
        events: EventSink<'_>,
    ) {
        if self.reported.refusal.replace((object, code)) != Some((object, code)) {
            self.report(PortEventKind::Refused { object, code }, events);
        }
    }

    pub(in crate::drive) fn report(&self, kind: PortEventKind, events: EventSink<'_>) {
        let motor = self.motor;
        events(PortEvent { motor, kind });
    }
}
