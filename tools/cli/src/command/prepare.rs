//! Bringing the robot to where it takes commands.

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Fault, OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;

use super::stream::FIRST_NEWS;
use super::watch::{Stop, enabled};
use i2ris_terminal::Failure;
use i2ris_terminal::Interrupt;

/// How long the drives may take to start, to find their zero, or to switch on.
const DRIVES: Nanos = Nanos::from_millis(15_000);

/// Brings the controller to ENABLED, if it is allowed to, and returns the state.
pub fn prepare(
    client: &mut Client,
    enable: bool,
    interrupt: &Interrupt,
) -> Result<OperatingStateMsg, Failure> {
    let silent = |error| {
        if matches!(error, ClientError::Timeout { .. }) {
            Stop::Silent.into()
        } else {
            error.into()
        }
    };
    let mut state = client
        .wait_for(FIRST_NEWS, |_| true)
        .map_err(|error| -> Failure { silent(error) })?;
    if enable && enabled(&state) == Err(Stop::NotEnabled(OperatingState::Paused)) {
        client.state_command(StateCommand::Resume)?;
        state = arrive(client, interrupt, "enabled", is_enabled)?;
    }
    if enable && enabled(&state) == Err(Stop::NotEnabled(OperatingState::Disabled)) {
        if !is_homed(&state) {
            insist(client, StateCommand::Home, interrupt)?;
            arrive(client, interrupt, "homed", is_homed)?;
        }
        insist(client, StateCommand::Enable, interrupt)?;
        state = arrive(client, interrupt, "enabled", is_enabled)?;
    }
    enabled(&state)?;
    Ok(state)
}

fn is_enabled(state: &OperatingStateMsg) -> bool {
    state.state == OperatingState::Enabled.number()
}

fn is_homed(state: &OperatingStateMsg) -> bool {
    state.flags & OperatingStateMsg::HOMED != 0 && state.flags & OperatingStateMsg::BUSY == 0
}

/// Waits until the state is as wanted; a fault or an interrupt ends the waiting.
fn arrive(
    client: &mut Client,
    interrupt: &Interrupt,
    name: &str,
    wanted: impl Fn(&OperatingStateMsg) -> bool,
) -> Result<OperatingStateMsg, Failure> {
    let is_fault = |state: &OperatingStateMsg| state.state == OperatingState::Fault.number();
    let state = match client.wait_for(DRIVES, |state| {
        wanted(state) || is_fault(state) || interrupt.came()
    }) {
        Err(ClientError::Timeout { waited }) => {
            let seconds = waited.as_seconds();
            return Err(format!(
                "the robot was not {name} within {seconds} s; see the controller's log"
            )
            .into());
        }
        other => other?,
    };
    if is_fault(&state) {
        return Err(Stop::Fault(Fault::from_number(state.fault).unwrap_or(Fault::None)).into());
    }
    if wanted(&state) {
        Ok(state)
    } else {
        Err(format!("interrupted before the robot was {name}").into())
    }
}

/// Drives that are still starting, or a state that is still changing, are worth waiting for.
fn insist(
    client: &mut Client,
    command: StateCommand,
    interrupt: &Interrupt,
) -> Result<(), ClientError> {
    let start = clock::now();
    loop {
        match client.state_command(command) {
            Err(ClientError::Refused {
                refusal: Refusal::DrivesNotReady | Refusal::Busy,
                ..
            }) if clock::now().since(start) < DRIVES && !interrupt.came() => {
                clock::sleep(Nanos::from_millis(50));
            }
            outcome => return outcome.map(drop),
        }
    }
}
