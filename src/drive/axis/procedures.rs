//! Procedures of an axis, step by step: switching the power stage; enabling without a jump, as the
//! target of the drive is its own position before it follows anything; homing, in which the drive
//! itself searches its home position.

use std::ops::RangeInclusive;

use super::interface::Transfer;
use crate::drive::cia402::{
    Controlword, DriveState, HOMING_MODE, PowerGoal, PowerStep, Statusword, power_step,
};
use crate::drive::event::TransitionError;
use crate::drive::family::{HomingPlan, ObjectMap};
use crate::drive::object::{AbortCode, Address, Setting, Value};
use crate::units::Counts;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ProcedureStatus {
    Running,
    Done,
    Failed(TransitionError),
}

/// Brings the CiA 402 state machine to a goal. Reads the state before every command, and waits for
/// the effect of a command before the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PowerSequence {
    goal: PowerGoal,
    next: NextAction,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NextAction {
    ReadState,
    /// Write this controlword; the drive was in this state.
    Command(Controlword, DriveState),
    /// The controlword was accepted; wait for the drive to leave this state.
    WaitForChange(DriveState),
}

impl PowerSequence {
    pub(super) fn new(goal: PowerGoal) -> Self {
        Self { goal, next: NextAction::ReadState }
    }

    /// Begins with a command: the drive is known to be in this state.
    pub(super) fn commanding(goal: PowerGoal, controlword: Controlword, from: DriveState) -> Self {
        Self { goal, next: NextAction::Command(controlword, from) }
    }

    /// Whether the next command has yet to be taken by the drive.
    pub(super) fn has_to_command(self) -> bool {
        !matches!(self.next, NextAction::WaitForChange(_))
    }

    pub(super) fn transfer(self) -> Transfer {
        match self.next {
            NextAction::ReadState | NextAction::WaitForChange(_) => Transfer::Status,
            NextAction::Command(controlword, _) => Transfer::Control(controlword),
        }
    }

    /// Continues after a transfer; `true` when the goal is reached.
    pub(super) fn advance(&mut self, transfer: Transfer, raw: u32) -> bool {
        let state = Statusword(u16::from_raw(raw)).state();
        match (transfer, self.next) {
            (Transfer::Control(_), NextAction::Command(_, from)) => {
                self.next = NextAction::WaitForChange(from);
                false
            }
            (Transfer::Status, _) => state.is_some_and(|state| self.update_state(state)),
            _ => false,
        }
    }

    fn update_state(&mut self, state: DriveState) -> bool {
        if self.next == NextAction::WaitForChange(state) {
            return false;
        }
        self.next = match power_step(state, self.goal) {
            PowerStep::Reached => return true,
            PowerStep::Command(controlword) => NextAction::Command(controlword, state),
            // The axis itself handles a fault.
            PowerStep::Wait | PowerStep::Blocked => NextAction::ReadState,
        };
        false
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum EnablingStep {
    /// Read a limit back: a drive that restarted since its configuration has lost all limits.
    LimitMin,
    /// Read the other limit back. In a restarted drive both are 0; the configuration never is.
    LimitMax,
    Position,
    /// Write it as target: an old target in the drive would be a jump.
    Preload(i32),
    Check(i32),
    SetMode,
    /// Wait until the mode is in force.
    Mode,
    Power(PowerSequence),
}

impl EnablingStep {
    pub(super) fn transfer(self, map: &ObjectMap) -> Transfer {
        match self {
            Self::LimitMin => Transfer::LimitMin,
            Self::LimitMax => Transfer::LimitMax,
            Self::Position => Transfer::Position,
            Self::Preload(target) => Transfer::Preload(target),
            Self::Check(_) => Transfer::Target,
            Self::SetMode => Transfer::SetMode(map.streaming_mode),
            Self::Mode => Transfer::Mode,
            Self::Power(power) => power.transfer(),
        }
    }

    pub(super) fn advance(
        &mut self,
        transfer: Transfer,
        raw: u32,
        map: &ObjectMap,
        limits: &RangeInclusive<i32>,
    ) -> ProcedureStatus {
        let value = i32::from_raw(raw);
        *self = match (*self, transfer) {
            (Self::LimitMin, Transfer::LimitMin) if value == *limits.start() => Self::LimitMax,
            (Self::LimitMax, Transfer::LimitMax) if value == *limits.end() => Self::Position,
            (Self::LimitMin, Transfer::LimitMin) | (Self::LimitMax, Transfer::LimitMax) => {
                return ProcedureStatus::Failed(TransitionError::Restarted);
            }
            (Self::Position, Transfer::Position) if limits.contains(&value) => Self::Preload(value),
            (Self::Position, Transfer::Position) => {
                return ProcedureStatus::Failed(TransitionError::OutsideLimits {
                    position: Counts(value),
                    min: Counts(*limits.start()),
                    max: Counts(*limits.end()),
                });
            }
            (Self::Preload(target), Transfer::Preload(_)) => Self::Check(target),
            (Self::Check(target), Transfer::Target) if value == target => Self::SetMode,
            (Self::Check(target), Transfer::Target) => {
                let (written, found) = (Counts(target), Counts(value));
                return ProcedureStatus::Failed(TransitionError::Preload { written, found });
            }
            (Self::SetMode, Transfer::SetMode(_)) => Self::Mode,
            (Self::Mode, Transfer::Mode) if i8::from_raw(raw) == map.streaming_mode => {
                Self::Power(PowerSequence::new(PowerGoal::On))
            }
            (Self::Power(mut power), _) => {
                if power.advance(transfer, raw) {
                    return ProcedureStatus::Done;
                }
                Self::Power(power)
            }
            (same, _) => same,
        };
        ProcedureStatus::Running
    }
}

/// Sequence of the homing steps. Numbers are indices into the lists of the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HomingStep {
    Position,
    /// Write it as target, in case the drive is not in homing mode after all. Before homing the
    /// position has no meaning, so the drive may refuse it as outside its limits; homing does not
    /// use the target.
    Preload(i32),
    SetMode,
    Mode,
    SetMethod,
    Method,
    /// Write the settings of the method; the low current limit comes first.
    Prepare(usize),
    CheckPrepared(usize),
    On(PowerSequence),
    Start,
    Run,
    /// Lower the start bit, ready for the next time.
    Lower,
    Off(PowerSequence),
    Restore(usize),
    CheckRestored(usize),
    /// Write the mode for setpoints.
    SetModeBack,
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

fn compare(setting: Option<&Setting>, found: u32) -> Result<(), TransitionError> {
    match setting {
        Some(&Setting { object, raw, .. }) if raw != found => {
            Err(TransitionError::ReadBack { object, written: raw, found })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_sent_once_and_wait_for_their_effect() {
        use DriveState::{OperationEnabled, Ready, SwitchOnDisabled, SwitchedOn};
        let shutdown = Transfer::Control(Controlword::SHUTDOWN);
        let enable = Transfer::Control(Controlword::ENABLE_OPERATION);
        let mut power = PowerSequence::new(PowerGoal::On);
        assert_eq!(power.transfer(), Transfer::Status);
        assert!(!power.update_state(SwitchOnDisabled));
        assert_eq!(power.transfer(), shutdown);
        assert_eq!(power.transfer(), shutdown, "until it is acknowledged");
        power.advance(shutdown, 0);
        assert_eq!(power.transfer(), Transfer::Status);
        assert!(!power.update_state(SwitchOnDisabled));
        assert_eq!(power.transfer(), Transfer::Status, "no effect yet");
        for state in [Ready, SwitchedOn] {
            assert!(!power.update_state(state));
            assert_eq!(power.transfer(), enable);
            power.advance(enable, 0);
        }
        assert!(power.update_state(OperationEnabled));
    }
}
