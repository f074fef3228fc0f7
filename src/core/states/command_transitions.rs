//! Command transitions: effect of every command in every state. This is the table in the
//! documentation of [`super::control_state`], cell by cell.

use crate::core::drive_status::DriveSummary;
use crate::core::states::automatic_transitions::{acknowledge, require_homing};
use crate::core::states::control_state::{
    ALL_OFF, ControlState, DisabledActivity, FaultStage, FaultState, HOLDING,
};
use crate::robot::{Refusal, StateCommand};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum CommandEffect {
    /// Nothing: the state is already as requested.
    NoChange,
    Change(ControlState),
    /// The drives start homing.
    Home,
    /// The drives at fault are reset, and the state changes.
    ResetFaults(ControlState),
    /// The zero of every axis becomes invalid.
    Unhome,
    /// A conditioning cycle starts, if the position limits allow it.
    Condition,
    /// Following ends, every other client is held, and the state may change.
    Hold(Option<ControlState>),
    /// A trajectory to a pose starts, if model and pose allow it.
    Move,
    /// The lease is returned, and the client's activity ends.
    Release,
    /// The virtual fixtures change, if the state allows it.
    ChangeFixtures,
}

/// The effect of a command, or the reason to refuse it.
pub(crate) fn command_effect(
    command: StateCommand,
    state: &ControlState,
    summary: &DriveSummary,
) -> Result<CommandEffect, Refusal> {
    match command {
        StateCommand::Enable => enable(state, summary),
        StateCommand::Disable => Ok(disable(state, summary)),
        StateCommand::Pause => pause(state),
        StateCommand::Resume => resume(state),
        StateCommand::Home => require_homing(state, summary).map(|()| CommandEffect::Home),
        StateCommand::Unhome => state.require_idle().map(|()| CommandEffect::Unhome),
        StateCommand::Condition => {
            require_motion_allowed(command, state, summary).map(|()| CommandEffect::Condition)
        }
        StateCommand::Acknowledge => Ok(match acknowledge(state, summary)? {
            resetting @ ControlState::Fault(_) => CommandEffect::ResetFaults(resetting),
            next => CommandEffect::Change(next),
        }),
        StateCommand::Release => Ok(CommandEffect::Release),
        StateCommand::Hold => hold(state, summary),
        StateCommand::Fixture => Ok(CommandEffect::ChangeFixtures),
        StateCommand::Move => {
            require_motion_allowed(command, state, summary).map(|()| CommandEffect::Move)
        }
    }
}

fn enable(state: &ControlState, summary: &DriveSummary) -> Result<CommandEffect, Refusal> {
    let going_off = match state {
        ControlState::Enabled(_) => return Ok(CommandEffect::NoChange),
        ControlState::Paused => return Err(Refusal::Paused),
        ControlState::Disabled(activity) => activity.then(true),
        ControlState::Fault(_) => None,
    };
    let enabling = if let Some(going_off) = going_off {
        summary.require_zero_and_range()?;
        going_off
    } else {
        state.require_idle()?;
        summary.require_enabling()?;
        DisabledActivity::Enabling { since: summary.now }
    };
    Ok(CommandEffect::Change(ControlState::Disabled(enabling)))
}

/// No state refuses `disable`: the operator must always be able to switch the robot off. A request
/// without a client id was refused before.
pub(crate) fn disable(state: &ControlState, summary: &DriveSummary) -> CommandEffect {
    use DisabledActivity::{Enabling, Homing, Stopping};
    let since = summary.now;
    match state {
        ControlState::Disabled(Enabling { .. } | Homing { .. }) => {
            CommandEffect::Change(ControlState::Disabled(DisabledActivity::powering_off(since)))
        }
        ControlState::Disabled(activity) => match activity.then(false) {
            Some(going_off) if going_off != *activity => {
                CommandEffect::Change(ControlState::Disabled(going_off))
            }
            Some(_) | None => CommandEffect::NoChange,
        },
        ControlState::Enabled(_) | ControlState::Paused => {
            CommandEffect::Change(ControlState::Disabled(Stopping { since, then_enable: false }))
        }
        ControlState::Fault(fault) => match fault.stage {
            FaultStage::Latched { demands, .. } if demands != ALL_OFF => {
                let stage = FaultStage::Latched { since, demands: ALL_OFF };
                CommandEffect::Change(ControlState::Fault(FaultState { stage, ..*fault }))
            }
            FaultStage::Latched { .. } | FaultStage::Resetting { .. } => CommandEffect::NoChange,
        },
    }
}

fn pause(state: &ControlState) -> Result<CommandEffect, Refusal> {
    match state {
        ControlState::Enabled(_) => Ok(CommandEffect::Change(ControlState::Paused)),
        ControlState::Paused => Ok(CommandEffect::NoChange),
        ControlState::Disabled(_) | ControlState::Fault(_) => Err(powered_only(state)),
    }
}

fn resume(state: &ControlState) -> Result<CommandEffect, Refusal> {
    match state {
        ControlState::Paused => Ok(CommandEffect::Change(HOLDING)),
        ControlState::Enabled(_) => Ok(CommandEffect::NoChange),
        ControlState::Disabled(_) | ControlState::Fault(_) => Err(powered_only(state)),
    }
}

/// `hold` ends every activity; while drives are changing, like `disable`.
fn hold(state: &ControlState, summary: &DriveSummary) -> Result<CommandEffect, Refusal> {
    let next = match state {
        ControlState::Enabled(_) | ControlState::Paused => (!state.is_holding()).then_some(HOLDING),
        ControlState::Disabled(DisabledActivity::Idle) | ControlState::Fault(_) => {
            return Err(powered_only(state));
        }
        ControlState::Disabled(_) => match disable(state, summary) {
            CommandEffect::Change(next) => Some(next),
            _ => None,
        },
    };
    Ok(CommandEffect::Hold(next))
}

/// Conditions of a conditioning cycle and of a trajectory: the same as of a servo command.
fn require_motion_allowed(
    command: StateCommand,
    state: &ControlState,
    summary: &DriveSummary,
) -> Result<(), Refusal> {
    // Whether a move replaces one in progress depends on its client.
    if state.trajectory().is_none() || command != StateCommand::Move {
        state.require_unoccupied()?;
    }
    match state {
        ControlState::Enabled(_) if !summary.is_homed => Err(Refusal::NotHomed),
        ControlState::Enabled(_) if !summary.is_fresh() => Err(Refusal::DrivesNotReady),
        ControlState::Enabled(_) => Ok(()),
        ControlState::Disabled(_) | ControlState::Paused | ControlState::Fault(_) => {
            Err(powered_only(state))
        }
    }
}

/// Refusal of a command that needs a robot that is on.
fn powered_only(state: &ControlState) -> Refusal {
    match state {
        ControlState::Disabled(DisabledActivity::Idle) | ControlState::Enabled(_) => {
            Refusal::NotEnabled
        }
        ControlState::Disabled(_) => Refusal::Busy,
        ControlState::Paused => Refusal::Paused,
        ControlState::Fault(_) => Refusal::InFault,
    }
}
