//! Homes and enables the robot of a controller.

use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, StateCommand};
use i2ris::units::Nanos;

/// Homes and enables the robot; each step may take so long.
///
/// # Errors
///
/// As [`Client::state_command`] and [`Client::wait_for`].
pub fn home_and_enable(client: &mut Client, timeout: Nanos) -> Result<(), ClientError> {
    let is_idle = |state: &OperatingStateMsg| state.flags & OperatingStateMsg::BUSY == 0;
    client.wait_for(timeout, is_idle)?;
    client.state_command(StateCommand::Home)?;
    client
        .wait_for(timeout, |state| is_idle(state) && state.flags & OperatingStateMsg::HOMED != 0)?;
    client.state_command(StateCommand::Enable)?;
    let enabled = OperatingState::Enabled.number();
    client.wait_for(timeout, |state| is_idle(state) && state.state == enabled)?;
    Ok(())
}
