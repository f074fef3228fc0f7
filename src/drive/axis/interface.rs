//! Interfaces of one axis: request and feedback, all that the control loop and a port thread
//! exchange; transfers, one request to the drive and its reply each.

use serde::{Deserialize, Serialize};

use crate::drive::cia402::{Controlword, DriveState, Statusword};
use crate::drive::family::ObjectMap;
use crate::drive::link::{LinkCounters, Retry};
use crate::drive::object::{self, Address, Setting};
use crate::robot::{AxisPhase, DrivePower};
use crate::units::{Counts, Nanos};

/// Request of the control loop to one drive. The newest replaces earlier ones: no queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct AxisRequest {
    /// Increases by one every tick.
    pub sequence: u64,
    /// The state that the drive is brought to and kept in.
    pub demand: Demand,
    /// Written only in [`Demand::Enabled`], after the drive was enabled at its own position.
    pub target: Counts,
    /// Increases by one for every fault reset that the operator acknowledged.
    pub fault_resets: u32,
    /// Increases by one for every homing that the operator requested.
    pub homings: u32,
    /// The operator has declared the zero invalid (`unhome`): no position is saved for the next
    /// start, which would trust it.
    pub zero_invalid: bool,
    /// Stamp of the command that set the target, to measure latency. Zero: none.
    pub command_stamp: Nanos,
    /// Sequence number of the command that set the target. Zero: none.
    pub command_sequence: u64,
}

/// The state that a drive is brought to. The safe default is [`Demand::Disabled`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Demand {
    /// Power stage off: operation disabled with a ramp, then shut down.
    #[default]
    Disabled,
    Enabled,
    /// Quick-stop ramp, then powered and holding.
    QuickStop,
}

/// State of one drive according to the newest replies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct AxisFeedback {
    /// Increases by one with every position that was read.
    pub sequence: u64,
    /// When the reply with `position` arrived. Zero: never.
    pub stamp: Nanos,
    /// Encoder position (0x6064).
    pub position: Counts,
    pub phase: AxisPhase,
    /// The position refers to the home position (statusword bit 15), and is trusted.
    pub homed: bool,
    /// The last setpoint that was written and acknowledged.
    pub written: Option<WrittenTarget>,
    /// Statusword (0x6041) as read.
    pub statusword: u16,
    /// Error code (0x603F; EPOS2 0x1003:01, in a fault only) as read; 0 = none.
    pub error_code: u16,
    /// Motor current (0x30D1:02; EPOS2 0x6078), mA.
    pub current_ma: i32,
    /// When the reply with `current_ma` arrived. Zero: never.
    pub current_stamp: Nanos,
    /// The last fault reset that was carried out, as counted in [`AxisRequest::fault_resets`].
    pub fault_resets: u32,
    /// The last homing that ended, successful or not, as counted in [`AxisRequest::homings`].
    pub homings: u32,
    pub counters: LinkCounters,
}

impl AxisFeedback {
    /// Known power of the drive. A drive that has not replied since `oldest` may have power.
    pub fn power(&self, oldest: Nanos) -> DrivePower {
        match self.phase.power() {
            _ if self.stamp < oldest => DrivePower::NotKnown,
            // It may still ramp down.
            DrivePower::Off
                if self.phase == AxisPhase::Faulted
                    && Statusword(self.statusword).state() != Some(DriveState::Fault) =>
            {
                DrivePower::On
            }
            power => power,
        }
    }
}

/// A setpoint that reached the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct WrittenTarget {
    pub target: Counts,
    /// When the last byte of the request was handed to the operating system.
    pub stamp: Nanos,
    /// [`AxisRequest::sequence`] of the request that was written.
    pub sequence: u64,
    pub command_stamp: Nanos,
    pub command_sequence: u64,
}

/// One transfer, named by its purpose: reads, then writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::drive) enum Transfer {
    Position,
    Status,
    ErrorCode,
    Current,
    LimitMin,
    LimitMax,
    Target,
    /// The mode in force.
    Mode,
    Method,
    ReadBack(Address),
    /// Write the setpoint of this request.
    Setpoint(AxisRequest),
    /// Trigger the setpoint of this request, which is written: an edge.
    TriggerSetpoint(AxisRequest),
    /// Write a target that the drive does not follow yet.
    Preload(i32),
    SetMode(i8),
    SetMethod(i8),
    /// Write a setting that homing needs, or restore it.
    Set(Setting),
    /// Command the CiA 402 state machine.
    Control(Controlword),
    /// Start homing: an edge, never sent twice.
    StartHoming,
}

/// A transfer in terms of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::drive) enum ObjectAccess {
    Read(Address),
    Write(Setting, Retry),
}

impl Transfer {
    pub(in crate::drive) fn access(self, map: &ObjectMap) -> ObjectAccess {
        use ObjectAccess::{Read, Write};
        let control = |controlword: Controlword| object::CONTROLWORD.set(controlword.0);
        match self {
            Self::Position => Read(object::POSITION.address()),
            Self::Status => Read(object::STATUSWORD.address()),
            Self::ErrorCode => Read(map.error_code.address()),
            Self::Current => Read(map.current),
            Self::LimitMin => Read(object::POSITION_MIN.address()),
            Self::LimitMax => Read(object::POSITION_MAX.address()),
            Self::Target => Read(map.target.address()),
            Self::Mode => Read(object::MODE_DISPLAY.address()),
            Self::Method => Read(object::HOMING_METHOD.address()),
            Self::ReadBack(object) => Read(object),
            // No retry: by then there is a newer setpoint.
            Self::Setpoint(request) => Write(map.target.set(request.target.0), Retry::Never),
            Self::TriggerSetpoint(_) => Write(control(Controlword::NEW_SETPOINT), Retry::Never),
            Self::Preload(target) => Write(map.target.set(target), Retry::Safe),
            Self::SetMode(mode) => Write(object::MODE.set(mode), Retry::Safe),
            Self::SetMethod(method) => Write(object::HOMING_METHOD.set(method), Retry::Safe),
            Self::Set(setting) => Write(setting, Retry::Safe),
            Self::Control(controlword) => Write(control(controlword), Retry::Safe),
            Self::StartHoming => Write(control(Controlword::START_HOMING), Retry::Never),
        }
    }

    pub(in crate::drive) fn object(self, map: &ObjectMap) -> Address {
        match self.access(map) {
            ObjectAccess::Read(object) => object,
            ObjectAccess::Write(setting, _) => setting.object,
        }
    }
}

/// Age of the last request at which a port stops its enabled axes. The loop writes a request every
/// tick, so this means that it hangs. It is for a controller without a watchdog, which would act
/// after 50 ms, and long, because without real time the loop may stall while the drive safely
/// holds.
const LOOP_TIMEOUT: Nanos = Nanos::from_millis(1000);

/// Watches the sequence numbers of the requests.
#[derive(Debug, Default)]
pub(in crate::drive) struct RequestWatchdog {
    sequence: u64,
    /// When the newest request was first seen.
    seen: Nanos,
    pub(in crate::drive) reported: bool,
}

impl RequestWatchdog {
    /// The time since the last new request, if it exceeds the timeout.
    pub(in crate::drive) fn expired(&mut self, sequence: u64, now: Nanos) -> Option<Nanos> {
        if sequence != self.sequence {
            (self.sequence, self.seen, self.reported) = (sequence, now, false);
        }
        let silence = now - self.seen;
        (silence >= LOOP_TIMEOUT).then_some(silence)
    }
}
