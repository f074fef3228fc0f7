//! Brings the robot to ENABLED.

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Fault, OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;

use super::stream_monitor::{StopReason, enabled};
use i2ris_terminal::Failure;
use i2ris_terminal::Interrupt;

/// Time limit for the first message of the controller.
pub(super) const FIRST_MESSAGE_TIMEOUT: Nanos = Nanos::from_millis(2000);
/// Time limit for the drives to start, to home, or to switch on.
const DRIVES_TIMEOUT: Nanos = Nanos::from_millis(15_000);

/// Brings the controller to ENABLED, if `enable` permits it, and returns the state.
pub fn prepare(
    client: &mut Client,
    enable: bool,
    interrupt: &Interrupt,
) -> Result<OperatingStateMsg, Failure> {
    let silent = |error| {
        if matches!(error, ClientError::Timeout { .. }) {
            StopReason::Silent.into()
        } else {
            error.into()
        }
    };
    let mut state = client
        .wait_for(FIRST_MESSAGE_TIMEOUT, |_| true)
        .map_err(|error| -> Failure { silent(error) })?;
    if enable && enabled(&state) == Err(StopReason::NotEnabled(OperatingState::Paused)) {
        client.state_command(StateCommand::Resume)?;
        state = wait_for_state(client, interrupt, "enabled", is_enabled)?;
    }
    if enable && enabled(&state) == Err(StopReason::NotEnabled(OperatingState::Disabled)) {
        if !is_homed(&state) {
            command_until_accepted(client, StateCommand::Home, interrupt)?;
            wait_for_state(client, interrupt, "homed", is_homed)?;
        }
        command_until_accepted(client, StateCommand::Enable, interrupt)?;
        state = wait_for_state(client, interrupt, "enabled", is_enabled)?;
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

/// Waits for a state. A fault or an interrupt ends the wait.
fn wait_for_state(
    client: &mut Client,
    interrupt: &Interrupt,
    name: &str,
    wanted: impl Fn(&OperatingStateMsg) -> bool,
) -> Result<OperatingStateMsg, Failure> {
    let is_fault = |state: &OperatingStateMsg| state.state == OperatingState::Fault.number();
    let state = match client.wait_for(DRIVES_TIMEOUT, |state| {
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
        return Err(
            StopReason::Fault(Fault::from_number(state.fault).unwrap_or(Fault::None)).into(),
        );
    }
    if wanted(&state) {
        Ok(state)
    } else {
        Err(format!("interrupted before the robot was {name}").into())
    }
}

/// Repeats a state command while the drives start or the state changes.
fn command_until_accepted(
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
            }) if clock::now().since(start) < DRIVES_TIMEOUT && !interrupt.came() => {
                clock::sleep(Nanos::from_millis(50));
            }
            outcome => return outcome.map(drop),
        }
    }
}
