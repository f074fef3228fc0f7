//! Switching the power stage, and enabling without a jump: the target of the drive is its own
//! position before it follows anything.

use std::ops::RangeInclusive;

use super::transfer::Transfer;
use crate::drive::cia402::{Controlword, DriveState, PowerGoal, PowerStep, Statusword, power_step};
use crate::drive::event::TransitionError;
use crate::drive::family::ObjectMap;
use crate::drive::object::Value;
use crate::units::Counts;

/// Status of a procedure after a step.
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
        let next = NextAction::ReadState;
        Self { goal, next }
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

/// Sequence of the enabling steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum EnablingStep {
    /// Read a position limit back: a drive that restarted since its configuration has lost all
    /// limits.
    LimitMin,
    /// Read the other limit back. In a restarted drive both are 0; the configuration never is.
    LimitMax,
    /// Read the position of the motor.
    Position,
    /// Write it as target: an old target in the drive would be a jump.
    Preload(i32),
    /// Read the target back.
    Check(i32),
    /// Write the mode.
    SetMode,
    /// Wait until the mode is in force.
    Mode,
    /// Switch on.
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
