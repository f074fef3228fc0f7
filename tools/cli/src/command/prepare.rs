//! Brings the robot to ENABLED, and carries out state commands to their end.

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Fault, OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;
use i2ris_report::{Failure, Interrupt, while_working};

use super::stream_monitor::{StopReason, enabled};

pub(super) const FIRST_MESSAGE_TIMEOUT: Nanos = Nanos::from_millis(2000);
const DRIVES_TIMEOUT: Nanos = Nanos::from_millis(15_000);
/// Time limit for motions of the controller's own: homing, conditioning, `move_jp`.
const MOTION_TIMEOUT: Nanos = Nanos::from_millis(300_000);
const REPEAT_PERIOD: Nanos = Nanos::from_millis(50);

pub const HOMING: &str = "the present pose becomes the zero (where no hard stop is configured)";

#[derive(Debug, Clone, Copy, clap::Args)]
pub struct PrepareOptions {
    /// Enable the robot first, where necessary
    #[arg(long, global = true)]
    enable: bool,
    /// Home the robot first, if its zero is not known, and enable it: the present pose becomes the
    /// zero, so straighten the snake before
    #[arg(long, global = true)]
    home: bool,
}

/// Brings the controller to ENABLED, as far as the options permit it, and returns the state.
pub fn prepare(
    client: &mut Client,
    options: PrepareOptions,
    interrupt: &Interrupt,
) -> Result<OperatingStateMsg, Failure> {
    let enable = options.enable || options.home;
    let mut state = client.wait_for(FIRST_MESSAGE_TIMEOUT, |_| true).map_err(silent)?;
    if enable && enabled(&state) == Err(StopReason::NotEnabled(OperatingState::Paused)) {
        state = carry_out(client, StateCommand::Resume, interrupt)?;
    }
    if enable && enabled(&state) == Err(StopReason::NotEnabled(OperatingState::Disabled)) {
        // Drives that are starting do not know yet whether they have kept their zero. The command
        // waits for them, and is refused if they have not.
        state = match carry_out(client, StateCommand::Enable, interrupt) {
            Err(failure) if is_not_homed(&failure) && options.home => {
                carry_out(client, StateCommand::Home, interrupt)?;
                carry_out(client, StateCommand::Enable, interrupt)?
            }
            Err(failure) if is_not_homed(&failure) => return Err(StopReason::NotHomed.into()),
            outcome => outcome?,
        };
    }
    enabled(&state)?;
    if is_busy(&state) {
        state = while_working("the robot is busy", || {
            wait_until(client, interrupt, "idle", MOTION_TIMEOUT, |state| !is_busy(state))
        })?;
        enabled(&state)?;
    }
    Ok(state)
}

/// Gives a state command and waits until it is carried out. A command that has to wait for the
/// drives, or for the end of another one, is repeated.
pub fn carry_out(
    client: &mut Client,
    command: StateCommand,
    interrupt: &Interrupt,
) -> Result<OperatingStateMsg, Failure> {
    if command == StateCommand::Home {
        eprintln!("homing: {HOMING}");
    }
    while_working(command.text(), || {
        command_until_accepted(client, command, interrupt)?;
        let outcome = wait_until(client, interrupt, done(command), MOTION_TIMEOUT, |state| {
            is_done(command, state)
        });
        if interrupt.came() && outcome.is_err() && command == StateCommand::Condition {
            client.state_command(StateCommand::Hold)?;
        }
        let state = outcome?;
        // Somebody else may have stopped it.
        if command == StateCommand::Condition {
            enabled(&state)?;
        }
        Ok(state)
    })
}

fn done(command: StateCommand) -> &'static str {
    match command {
        StateCommand::Enable => "enabled",
        StateCommand::Disable => "disabled",
        StateCommand::Home => "homed",
        StateCommand::Pause => "at rest",
        _ => "ready",
    }
}

fn is_done(command: StateCommand, state: &OperatingStateMsg) -> bool {
    let is_in = |wanted: OperatingState| state.state == wanted.number();
    let reached = match command {
        StateCommand::Enable | StateCommand::Resume => is_in(OperatingState::Enabled),
        // FAULT stays, with the drives off.
        StateCommand::Disable => is_in(OperatingState::Disabled) || is_in(OperatingState::Fault),
        StateCommand::Home => is_homed(state),
        StateCommand::Release | StateCommand::Hold | StateCommand::Move | StateCommand::Fixture => {
            return true;
        }
        StateCommand::Acknowledge => !is_in(OperatingState::Fault),
        StateCommand::Pause | StateCommand::Unhome | StateCommand::Condition => true,
    };
    reached && !is_busy(state)
}

fn is_not_homed(failure: &Failure) -> bool {
    matches!(failure.downcast_ref(), Some(ClientError::Refused { refusal: Refusal::NotHomed, .. }))
}

fn is_homed(state: &OperatingStateMsg) -> bool {
    state.flags & OperatingStateMsg::HOMED != 0
}

fn is_busy(state: &OperatingStateMsg) -> bool {
    state.flags & OperatingStateMsg::BUSY != 0
}

fn silent(error: ClientError) -> Failure {
    if matches!(error, ClientError::Timeout { .. }) {
        StopReason::Silent.into()
    } else {
        error.into()
    }
}

/// Waits for a state. A fault that begins meanwhile, or an interrupt, ends the wait.
fn wait_until(
    client: &mut Client,
    interrupt: &Interrupt,
    name: &str,
    limit: Nanos,
    wanted: impl Fn(&OperatingStateMsg) -> bool,
) -> Result<OperatingStateMsg, Failure> {
    let is_fault = |state: &OperatingStateMsg| {
        state.state == OperatingState::Fault.number() && !is_busy(state)
    };
    let state = match client
        .wait_for(limit, |state| wanted(state) || is_fault(state) || interrupt.came())
    {
        Err(ClientError::Timeout { waited }) => {
            let seconds = waited.as_seconds();
            return Err(format!(
                "the robot was not {name} within {seconds} s; see the controller's log"
            )
            .into());
        }
        other => other?,
    };
    if wanted(&state) {
        Ok(state)
    } else if is_fault(&state) {
        let fault = Fault::from_number(state.fault).unwrap_or(Fault::None);
        Err(StopReason::Fault(fault).into())
    } else {
        Err(format!("interrupted before the robot was {name}").into())
    }
}

/// Repeats a state command while the drives start, the state changes, or the robot moves by itself.
fn command_until_accepted(
    client: &mut Client,
    command: StateCommand,
    interrupt: &Interrupt,
) -> Result<(), ClientError> {
    let start = clock::now();
    loop {
        let refused = match client.state_command(command) {
            Err(refused @ ClientError::Refused { .. }) => refused,
            outcome => return outcome.map(drop),
        };
        let limit = match &refused {
            ClientError::Refused { refusal: Refusal::DrivesNotReady, .. } => DRIVES_TIMEOUT,
            ClientError::Refused { refusal: Refusal::Busy | Refusal::Conditioning, .. } => {
                MOTION_TIMEOUT
            }
            _ => return Err(refused),
        };
        if interrupt.came() || clock::now().since(start) > limit {
            return Err(refused);
        }
        clock::sleep(REPEAT_PERIOD);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(state: OperatingState, flags: u32) -> OperatingStateMsg {
        OperatingStateMsg { state: state.number(), flags, ..OperatingStateMsg::default() }
    }

    #[test]
    fn a_command_is_done_when_the_robot_is_no_longer_busy_with_it() {
        let (busy, homed) = (OperatingStateMsg::BUSY, OperatingStateMsg::HOMED);
        let disabled = OperatingState::Disabled;
        for (command, undone, after) in [
            (StateCommand::Home, state(disabled, 0), state(disabled, homed)),
            (StateCommand::Home, state(disabled, homed | busy), state(disabled, homed)),
            (StateCommand::Enable, state(disabled, busy), state(OperatingState::Enabled, 0)),
            (
                StateCommand::Condition,
                state(OperatingState::Enabled, busy),
                state(OperatingState::Enabled, 0),
            ),
            (
                StateCommand::Disable,
                state(OperatingState::Enabled, 0),
                state(OperatingState::Fault, 0),
            ),
        ] {
            assert!(!is_done(command, &undone), "{command}");
            assert!(is_done(command, &after), "{command}");
        }
    }
}
