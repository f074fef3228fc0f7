//! The transfers that an axis can ask for: one request to the drive and its reply each.

use super::interface::AxisRequest;
use crate::drive::cia402::Controlword;
use crate::drive::family::ObjectMap;
use crate::drive::link::Retry;
use crate::drive::object::{self, Address, Setting};

/// One transfer, named by its purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::drive) enum Transfer {
    /// Read the encoder position.
    Position,
    /// Read the statusword.
    Status,
    /// Read the last error.
    ErrorCode,
    /// Read the motor current.
    Current,
    /// Read the lower position limit back.
    LimitMin,
    /// Read the upper position limit back.
    LimitMax,
    /// Read the target back.
    Target,
    /// Read the mode in force.
    Mode,
    /// Read the homing method back.
    Method,
    /// Read a setting back.
    ReadBack(Address),
    /// Write the setpoint of this request.
    Setpoint(AxisRequest),
    /// Trigger the setpoint of this request, which is written: an edge.
    TriggerSetpoint(AxisRequest),
    /// Write a target that the drive does not follow yet.
    Preload(i32),
    /// Write a mode.
    SetMode(i8),
    /// Write a homing method.
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

    /// The object that is read or written.
    pub(in crate::drive) fn object(self, map: &ObjectMap) -> Address {
        match self.access(map) {
            ObjectAccess::Read(object) => object,
            ObjectAccess::Write(setting, _) => setting.object,
        }
    }
}
