//! The exchanges that an axis asks for.

use crate::drive::AxisRequest;
use crate::drive::cia402::Controlword;
use crate::drive::exchange::Repeat;
use crate::drive::family::Parts;
use crate::drive::object::{Address, Setting};

/// One exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::drive) enum Ask {
    /// Read the encoder position.
    Position,
    /// Read the statusword.
    Status,
    /// Read the last error.
    ErrorCode,
    /// Read the motor current.
    Current,
    /// Read the lowest position limit back.
    LimitMin,
    /// Read the highest position limit back.
    LimitMax,
    /// Read the target back.
    Target,
    /// Read the mode in force.
    Mode,
    /// Read the homing method back.
    Method,
    /// Follow the set-point of this request.
    Follow(AxisRequest),
    /// Set a target that the drive does not follow yet.
    Preload(i32),
    /// Choose a mode.
    SetMode(i8),
    /// Choose a homing method.
    SetMethod(i8),
    /// Command the state machine.
    Control(Controlword),
    /// Start homing: an edge, not to be sent twice.
    StartHoming,
    /// Set what homing needs, or put it back.
    Set(Setting),
    /// Read that back.
    ReadBack(Address),
    /// Make the set-point of this request, which is written, take effect: an edge.
    Take(AxisRequest),
}

/// An exchange in terms of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::drive) enum Access {
    Read(Address),
    Write(Setting, Repeat),
}

impl Ask {
    pub(in crate::drive) fn access(self, parts: &Parts) -> Access {
        match self {
            Self::Position => Access::Read(parts.position.address()),
            Self::Status => Access::Read(parts.statusword.address()),
            Self::ErrorCode => Access::Read(parts.error_code.address()),
            Self::Current => Access::Read(parts.current),
            Self::LimitMin => Access::Read(parts.position_min.address()),
            Self::LimitMax => Access::Read(parts.position_max.address()),
            Self::Target => Access::Read(parts.target.address()),
            Self::Mode => Access::Read(parts.mode_display.address()),
            Self::Method => Access::Read(parts.homing_method.address()),
            // Not repeated: by the time that a retry could be sent there is a newer set-point.
            Self::Follow(request) => {
                Access::Write(parts.target.set(request.target.0), Repeat::Never)
            }
            Self::Preload(target) => Access::Write(parts.target.set(target), Repeat::Safe),
            Self::SetMode(mode) => Access::Write(parts.mode.set(mode), Repeat::Safe),
            Self::SetMethod(method) => Access::Write(parts.homing_method.set(method), Repeat::Safe),
            Self::Control(controlword) => {
                Access::Write(parts.controlword.set(controlword.0), Repeat::Safe)
            }
            Self::Set(setting) => Access::Write(setting, Repeat::Safe),
            Self::ReadBack(object) => Access::Read(object),
            Self::Take(_) => Access::Write(
                parts.controlword.set(Controlword::NEW_SETPOINT.0),
                Repeat::Never,
            ),
            Self::StartHoming => Access::Write(
                parts.controlword.set(Controlword::START_HOMING.0),
                Repeat::Never,
            ),
        }
    }

    /// The object that is read or written.
    pub(in crate::drive) fn object(self, parts: &Parts) -> Address {
        match self.access(parts) {
            Access::Read(object) => object,
            Access::Write(setting, _) => setting.object,
        }
    }
}
