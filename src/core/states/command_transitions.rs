//! What every command does in every state: the table of [`crate::core`], cell by cell.

use crate::core::states::drive_status::{Sight, off};
use crate::core::states::state::{Failure, Inactive, Motion, Stage, State};
use crate::drive::{AxisPhase, Demand};
use crate::robot::{Refusal, StateCommand};
use crate::units::MAX_MOTORS;

const OFF: [Demand; MAX_MOTORS] = [Demand::Disabled; MAX_MOTORS];

/// An accepted command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Verdict {
    /// Already so.
    Nothing,
    /// The state changes.
    Change(State),
    /// The drives look for their zero, and the state changes.
    Home(State),
    /// The drives at fault are reset, and the state changes.
    Reset(State),
    /// The zero is forgotten.
    Unhome,
    /// A stroke begins, if the lease and the room allow it.
    Condition,
    /// A way to a pose begins, if lease, model and pose allow it.
    Move,
    /// The lease is given back, if the client has it.
    Release,
}

/// What a command does, or why it may not.
pub(crate) fn judge(
    command: StateCommand,
    state: &State,
    sight: &Sight,
) -> Result<Verdict, Refusal> {
    match command {
        StateCommand::Enable => enable(state, sight),
        StateCommand::Disable => Ok(disable(state, sight)),
        StateCommand::Pause => pause(state),
        StateCommand::Resume => resume(state),
        StateCommand::Home => home(state, sight),
        StateCommand::Unhome => idle(state).map(|()| Verdict::Unhome),
        StateCommand::Condition => motion(state, sight).map(|()| Verdict::Condition),
        StateCommand::Acknowledge => acknowledge(state, sight),
        StateCommand::Release => Ok(Verdict::Release),
        StateCommand::Hold => hold(state),
        StateCommand::Move => motion(state, sight).map(|()| Verdict::Move),
    }
}

/// Only from DISABLED with nothing under way.
fn idle(state: &State) -> Result<(), Refusal> {
    match state {
        State::Disabled(Inactive::Idle) => Ok(()),
        State::Disabled(_) => Err(Refusal::Busy),
        State::Enabled(_) | State::Paused | State::Fault(_) => Err(Refusal::State),
    }
}

fn ready(sight: &Sight) -> Result<(), Refusal> {
    if sight.all(AxisPhase::Disabled) && sight.fresh() {
        Ok(())
    } else {
        Err(Refusal::DrivesNotReady)
    }
}

fn enable(state: &State, sight: &Sight) -> Result<Verdict, Refusal> {
    idle(state)?;
    ready(sight)?;
    if !sight.homed {
        return Err(Refusal::NotHomed);
    }
    if !sight.in_range {
        return Err(Refusal::Range);
    }
    Ok(Verdict::Change(State::Disabled(Inactive::Enabling {
        since: sight.now,
    })))
}

fn home(state: &State, sight: &Sight) -> Result<Verdict, Refusal> {
    idle(state)?;
    ready(sight)?;
    Ok(Verdict::Home(State::Disabled(Inactive::Homing {
        since: sight.now,
    })))
}

/// Never refused: it is the operator's way to switch off.
pub(crate) fn disable(state: &State, sight: &Sight) -> Verdict {
    let since = sight.now;
    match state {
        State::Disabled(
            Inactive::Idle
            | Inactive::Stopping { .. }
            | Inactive::Settling { .. }
            | Inactive::PoweringOff { .. },
        )
        | State::Fault(Failure {
            stage: Stage::Resetting { .. },
            ..
        }) => Verdict::Nothing,
        State::Disabled(Inactive::Enabling { .. } | Inactive::Homing { .. }) => {
            Verdict::Change(State::Disabled(Inactive::PoweringOff { since }))
        }
        State::Enabled(_) | State::Paused => {
            Verdict::Change(State::Disabled(Inactive::Stopping { since }))
        }
        State::Fault(Failure {
            stage: Stage::Latched { demands, .. },
            ..
        }) if *demands == OFF => Verdict::Nothing,
        State::Fault(Failure {
            cause,
            stage: Stage::Latched { .. },
        }) => {
            let stage = Stage::Latched {
                since,
                demands: OFF,
            };
            Verdict::Change(State::Fault(Failure {
                cause: *cause,
                stage,
            }))
        }
    }
}

fn pause(state: &State) -> Result<Verdict, Refusal> {
    match state {
        State::Enabled(_) => Ok(Verdict::Change(State::Paused)),
        State::Paused => Ok(Verdict::Nothing),
        State::Disabled(Inactive::Idle) | State::Fault(_) => Err(Refusal::State),
        State::Disabled(_) => Err(Refusal::Busy),
    }
}

fn resume(state: &State) -> Result<Verdict, Refusal> {
    match state {
        State::Paused => Ok(Verdict::Change(State::Enabled(Motion::Holding))),
        State::Disabled(Inactive::Idle) | State::Enabled(_) | State::Fault(_) => {
            Err(Refusal::State)
        }
        State::Disabled(_) => Err(Refusal::Busy),
    }
}

fn hold(state: &State) -> Result<Verdict, Refusal> {
    match state {
        State::Enabled(Motion::Holding) | State::Paused => Ok(Verdict::Nothing),
        State::Enabled(_) => Ok(Verdict::Change(State::Enabled(Motion::Holding))),
        State::Disabled(Inactive::Idle) | State::Fault(_) => Err(Refusal::State),
        State::Disabled(_) => Err(Refusal::Busy),
    }
}

/// Motion of the robot's own. The drives are on in ENABLED, so what has to be looked at is what a
/// servo command needs, too.
fn motion(state: &State, sight: &Sight) -> Result<(), Refusal> {
    match state {
        State::Enabled(_) if state.occupied() => Err(Refusal::Busy),
        State::Enabled(_) if !sight.homed => Err(Refusal::NotHomed),
        State::Enabled(_) if !sight.fresh() => Err(Refusal::DrivesNotReady),
        State::Enabled(_) => Ok(()),
        State::Disabled(Inactive::Idle) | State::Paused | State::Fault(_) => Err(Refusal::State),
        State::Disabled(_) => Err(Refusal::Busy),
    }
}

/// Accepted once the cause can clear: every drive answers, stands where the fault sent it, and the
/// model is sound. Drives at fault are reset first.
fn acknowledge(state: &State, sight: &Sight) -> Result<Verdict, Refusal> {
    match state {
        State::Fault(Failure {
            stage: Stage::Resetting { .. },
            ..
        }) => Err(Refusal::Busy),
        State::Fault(failure) if clearable(sight) => Ok(clear(failure, sight)),
        State::Fault(_) => Err(Refusal::CausePersists),
        State::Disabled(_) | State::Enabled(_) | State::Paused => Err(Refusal::State),
    }
}

fn clearable(sight: &Sight) -> bool {
    let arrived = |phase| match phase {
        AxisPhase::Lost | AxisPhase::Starting => false,
        AxisPhase::QuickStopped => true,
        other => off(other),
    };
    sight.model_sound && sight.fresh() && sight.drives().all(|axis| arrived(axis.phase))
}

fn clear(failure: &Failure, sight: &Sight) -> Verdict {
    let since = sight.now;
    if sight.drives().any(|axis| axis.phase == AxisPhase::Faulted) {
        let stage = Stage::Resetting { since };
        Verdict::Reset(State::Fault(Failure {
            cause: failure.cause,
            stage,
        }))
    } else {
        Verdict::Change(State::Disabled(Inactive::PoweringOff { since }))
    }
}

/// A command that has no place in a process that ends.
pub(crate) fn sets_going(command: StateCommand) -> bool {
    match command {
        StateCommand::Enable
        | StateCommand::Resume
        | StateCommand::Home
        | StateCommand::Unhome
        | StateCommand::Condition
        | StateCommand::Move => true,
        StateCommand::Disable
        | StateCommand::Pause
        | StateCommand::Acknowledge
        | StateCommand::Release
        | StateCommand::Hold => false,
    }
}
