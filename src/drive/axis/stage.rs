//! The stages of an axis, finer than the phases that the control loop sees.

use super::ask::Ask;
use super::enabling::Enabling;
use super::homing::Homing;
use super::power::Power;
use crate::drive::AxisPhase;
use crate::drive::cia402::Controlword;
use crate::drive::family::{HomingPlan, Parts};
use crate::units::Nanos;

/// Where an axis stands. Instants are deadlines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    /// Configured; its state has not been read yet.
    Starting,
    /// Power stage off.
    Disabled,
    /// On the way to enabled.
    Enabling(Enabling, Nanos),
    /// The target is followed.
    Enabled,
    /// Quick stop is asked for, the drive does not report it yet.
    QuickStopping(Power, Nanos),
    /// Quick stop is active. By the deadline the motor stands, or will not any more.
    QuickStopped(Nanos),
    /// Looking for the zero; the number is the request that it answers.
    Homing(Homing, Nanos, u32),
    /// On the way to disabled; at the deadline the power is cut instead.
    Disabling(Power, Nanos),
    /// A fault holds the drive.
    Faulted(FaultStep),
    /// It does not answer.
    Lost,
}

/// What is done about a fault. The number is the fault reset that is being carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FaultStep {
    /// Read the error code.
    Code,
    /// Wait for the operator.
    Rest,
    /// Lower the reset bit: only its rising edge counts.
    Lower(u32),
    /// Raise it.
    Raise(u32),
    /// Wait for the fault to go.
    Watch(u32, Nanos),
}

impl FaultStep {
    /// The fault reset that is being carried out.
    pub(super) fn count(self) -> Option<u32> {
        match self {
            Self::Code | Self::Rest => None,
            Self::Lower(count) | Self::Raise(count) | Self::Watch(count, _) => Some(count),
        }
    }
}

impl Stage {
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

    /// What the stage needs to move on; `None` if it only watches.
    pub(super) fn ask(self, parts: &Parts, plan: &HomingPlan) -> Option<Ask> {
        match self {
            Self::Enabling(enabling, _) => Some(enabling.ask(parts)),
            Self::Homing(homing, ..) => Some(homing.ask(parts, plan)),
            Self::QuickStopping(power, _) | Self::Disabling(power, _) => Some(power.ask()),
            Self::Faulted(step) => match step {
                FaultStep::Code => Some(Ask::ErrorCode),
                FaultStep::Lower(_) => Some(Ask::Control(Controlword::DISABLE_VOLTAGE)),
                FaultStep::Raise(_) => Some(Ask::Control(Controlword::FAULT_RESET)),
                FaultStep::Watch(..) => Some(Ask::Status),
                FaultStep::Rest => None,
            },
            Self::Starting => Some(Ask::Status),
            Self::Disabled | Self::Enabled | Self::QuickStopped(..) | Self::Lost => None,
        }
    }
}
