//! Homing: the drive itself searches its home position.

use super::enabling::{PowerSequence, ProcedureStatus};
use super::transfer::Transfer;
use crate::drive::abort_code::AbortCode;
use crate::drive::cia402::{Controlword, HOMING_MODE, PowerGoal, Statusword};
use crate::drive::event::TransitionError;
use crate::drive::family::ObjectMap;
use crate::drive::homing_plan::HomingPlan;
use crate::drive::object::{Address, Setting, Value};

/// Sequence of the homing steps. Numbers are indices into the lists of the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HomingStep {
    /// Read the position of the motor.
    Position,
    /// Write it as target, in case the drive is not in homing mode after all. Before homing the
    /// position has no meaning, so the drive may refuse it as outside its limits; homing does not
    /// use the target.
    Preload(i32),
    /// Write the homing mode.
    SetMode,
    /// Wait until it is in force.
    Mode,
    /// Write the method.
    SetMethod,
    /// Read it back.
    Method,
    /// Write the settings of the method; the low current limit comes first.
    Prepare(usize),
    /// Read them back.
    CheckPrepared(usize),
    /// Switch on.
    On(PowerSequence),
    Start,
    /// Wait for the end.
    Run,
    /// Lower the start bit, ready for the next time.
    Lower,
    /// Switch off.
    Off(PowerSequence),
    /// Restore the settings.
    Restore(usize),
    /// Read them back.
    CheckRestored(usize),
    /// Write the mode for setpoints.
    SetModeBack,
    /// Wait until it is in force.
    ModeBack,
}

impl HomingStep {
    pub(super) fn transfer(self, map: &ObjectMap, plan: &HomingPlan) -> Transfer {
        let write = |setting: &Setting| Transfer::Set(*setting);
        let read_back = |setting: &Setting| Transfer::ReadBack(setting.object);
        // An index is always inside its list.
        let prepared = |index| plan.settings.get(index);
        let restored = |index| plan.restored.get(index);
        match self {
            Self::Position => Transfer::Position,
            Self::Preload(target) => Transfer::Preload(target),
            Self::SetMode => Transfer::SetMode(HOMING_MODE),
            Self::SetModeBack => Transfer::SetMode(map.streaming_mode),
            Self::Mode | Self::ModeBack => Transfer::Mode,
            Self::SetMethod => Transfer::SetMethod(plan.method),
            Self::Method => Transfer::Method,
            Self::Prepare(index) => prepared(index).map_or(Transfer::Status, write),
            Self::CheckPrepared(index) => prepared(index).map_or(Transfer::Status, read_back),
            Self::Restore(index) => restored(index).map_or(Transfer::Status, write),
            Self::CheckRestored(index) => restored(index).map_or(Transfer::Status, read_back),
            Self::On(power) | Self::Off(power) => power.transfer(),
            Self::Start => Transfer::StartHoming,
            Self::Run => Transfer::Status,
            Self::Lower => Transfer::Control(Controlword::ENABLE_OPERATION),
        }
    }

    pub(super) fn advance(
        &mut self,
        transfer: Transfer,
        raw: u32,
        map: &ObjectMap,
        plan: &HomingPlan,
    ) -> ProcedureStatus {
        match self.next(transfer, raw, map, plan) {
            Ok(Some(next)) => {
                *self = next;
                ProcedureStatus::Running
            }
            Ok(None) => ProcedureStatus::Done,
            Err(error) => ProcedureStatus::Failed(error),
        }
    }

    /// The next step; `None` after the last.
    fn next(
        self,
        transfer: Transfer,
        raw: u32,
        map: &ObjectMap,
        plan: &HomingPlan,
    ) -> Result<Option<Self>, TransitionError> {
        let mode = i8::from_raw(raw);
        Ok(Some(match (self, transfer) {
            (Self::Position, Transfer::Position) => Self::Preload(i32::from_raw(raw)),
            (Self::Preload(_), Transfer::Preload(_)) => Self::SetMode,
            (Self::SetMode, Transfer::SetMode(_)) => Self::Mode,
            (Self::Mode, Transfer::Mode) if mode == HOMING_MODE => Self::SetMethod,
            (Self::SetMethod, Transfer::SetMethod(_)) => Self::Method,
            (Self::Method, Transfer::Method) if i8::from_raw(raw) == plan.method => {
                Self::prepare(0, plan)
            }
            (Self::Method, Transfer::Method) => return Err(TransitionError::HomingMethod),
            (Self::Prepare(index), Transfer::Set(_)) => Self::CheckPrepared(index),
            (Self::CheckPrepared(index), Transfer::ReadBack(_)) => {
                compare(plan.settings.get(index), raw)?;
                Self::prepare(index + 1, plan)
            }
            (Self::On(mut power), _) => {
                if power.advance(transfer, raw) {
                    Self::Start
                } else {
                    Self::On(power)
                }
            }
            (Self::Start, Transfer::StartHoming) => Self::Run,
            (Self::Run, Transfer::Status) => match Statusword(u16::from_raw(raw)) {
                word if word.homing_error() => return Err(TransitionError::HomingError),
                word if word.homing_attained() => Self::Lower,
                _ => Self::Run,
            },
            (Self::Lower, Transfer::Control(_)) => Self::Off(PowerSequence::new(PowerGoal::Off)),
            (Self::Off(mut power), _) => {
                if power.advance(transfer, raw) {
                    Self::restore(0, plan)
                } else {
                    Self::Off(power)
                }
            }
            (Self::Restore(index), Transfer::Set(_)) => Self::CheckRestored(index),
            (Self::CheckRestored(index), Transfer::ReadBack(_)) => {
                compare(plan.restored.get(index), raw)?;
                Self::restore(index + 1, plan)
            }
            (Self::SetModeBack, Transfer::SetMode(_)) => Self::ModeBack,
            (Self::ModeBack, Transfer::Mode) if mode == map.streaming_mode => return Ok(None),
            (same, _) => same,
        }))
    }

    fn prepare(index: usize, plan: &HomingPlan) -> Self {
        if index < plan.settings.len() {
            Self::Prepare(index)
        } else {
            Self::On(PowerSequence::new(PowerGoal::On))
        }
    }

    fn restore(index: usize, plan: &HomingPlan) -> Self {
        if index < plan.restored.len() { Self::Restore(index) } else { Self::SetModeBack }
    }

    /// The drive refused a step.
    pub(super) fn handle_refusal(&mut self, object: Address, code: AbortCode) -> ProcedureStatus {
        if let Self::Preload(_) = self {
            *self = Self::SetMode;
            return ProcedureStatus::Running;
        }
        ProcedureStatus::Failed(TransitionError::Refused { object, code })
    }

    /// A step was not answered. Every step but the start may be repeated.
    pub(super) fn handle_timeout(self) -> ProcedureStatus {
        if self == Self::Start {
            ProcedureStatus::Failed(TransitionError::Unanswered)
        } else {
            ProcedureStatus::Running
        }
    }

    /// The drive must be powered in this step: leaving operation enabled is an error.
    pub(super) fn is_powered(self) -> bool {
        matches!(self, Self::Start | Self::Run | Self::Lower)
    }
}

/// Compares the value that was read back with the setting.
fn compare(setting: Option<&Setting>, found: u32) -> Result<(), TransitionError> {
    match setting {
        Some(&Setting { object, raw, .. }) if raw != found => {
            Err(TransitionError::ReadBack { object, written: raw, found })
        }
        _ => Ok(()),
    }
}
