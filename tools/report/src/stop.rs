//! Stops the robot, whichever client commands it: `i2ris stop`, and the key `s` of `teleop
//! --keyboard`.

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, OperatingState, Refusal, StateCommand, find_client_process};
use i2ris::robot::KnownPower;
use i2ris::units::Nanos;

/// Time to find out what there is to stop. The stop must not wait longer.
const LOOK: Nanos = Nanos::from_millis(25);
const POLL_PERIOD: Nanos = Nanos::from_millis(1);
const SETTLE: Nanos = Nanos::from_millis(1000);

#[derive(Debug)]
pub struct Stopped {
    /// Stopped activities, and the state afterwards.
    pub text: String,
    /// The robot is confirmed to be at rest.
    pub is_known: bool,
}

/// Ends every motion and waits until nothing moves. The result says if drives are off.
pub fn stop(client: &mut Client, domain: &Domain) -> Result<Stopped, ClientError> {
    // Without an answer to this query, the stop is still sent.
    let before = newest(client, LOOK).ok().flatten();
    let mut what = before.map_or("all motion".to_owned(), |state| activity(&state, domain));
    let held = match client.state_command(StateCommand::Hold) {
        Ok(_) => match client.wait_until_done(StateCommand::Hold, || false) {
            // The robot was disabled in the meantime, or is in FAULT.
            Err(ClientError::Interrupted { .. }) => None,
            still => Some(still?),
        },
        // There is nothing to hold while drives are switched on or search for their zero.
        Err(ClientError::Refused { refusal: Refusal::Busy, .. }) => {
            Some(client.carry_out(StateCommand::Disable, || false)?)
        }
        Err(ClientError::Refused { refusal: Refusal::NotEnabled | Refusal::InFault, .. }) => {
            // It refuses only because no client is followed.
            what = "nothing".to_owned();
            None
        }
        Err(error) => return Err(error),
    };
    // Drives that a fault has just stopped need a few exchanges to report it.
    let is_still = |state: &OperatingStateMsg| {
        let has = |flags: u32| state.flags & flags == flags;
        has(OperatingStateMsg::HOLDING | OperatingStateMsg::AT_REST)
            || has(OperatingStateMsg::STOPPED)
    };
    let (state, is_known) = match held.map_or_else(|| client.wait_for(SETTLE, is_still), Ok) {
        Err(ClientError::Timeout(_)) => (client.wait_for(SETTLE, |_| true)?, false),
        still => (still?, true),
    };
    let name = OperatingState::from_number(state.state).map_or("?", OperatingState::text);
    let how = match is_known {
        false => "NOT CONFIRMED to be at rest: no report from a drive",
        true if state.power() == KnownPower::NotOff => "holds still",
        true => state.power().text(),
    };
    Ok(Stopped { text: format!("the robot is {name}, {how}; stopped: {what}"), is_known })
}

fn newest(client: &mut Client, span: Nanos) -> Result<Option<OperatingStateMsg>, ClientError> {
    // Opening the stream takes time.
    client.operating_state()?;
    let start = clock::now();
    loop {
        let state = client.operating_state()?;
        if state.is_some() || clock::now().duration_since(start) > span {
            return Ok(state);
        }
        clock::sleep(POLL_PERIOD);
    }
}

/// Running activities of a state.
fn activity(state: &OperatingStateMsg, domain: &Domain) -> String {
    let is_on = state.state == OperatingState::Enabled.number();
    let holder = Some(state.lease_client_id).filter(|client| *client != 0).map(|client| {
        let process = find_client_process(domain, state.boot_id, client);
        process.map_or("an unknown client".to_owned(), |process| process.to_string())
    });
    let busy = match is_on {
        _ if state.flags & OperatingStateMsg::BUSY == 0 => None,
        true => Some("a motion of the controller's own".to_owned()),
        false => Some("a change of state".to_owned()),
    };
    let all: Vec<String> = holder.into_iter().chain(busy).collect();
    if all.is_empty() { "nothing".to_owned() } else { all.join(" and ") }
}
