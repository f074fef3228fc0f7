//! H06: the encoder zero is lost.

use i2ris::clock;
use i2ris::ipc::client::ClientError;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;
use i2ris_testing::{Rig, has, settle_in, wait_for};

#[test]
fn h06_a_drive_that_lost_its_power_has_to_be_homed_again() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    client.state_command(StateCommand::Disable).unwrap();
    settle_in(&mut client, OperatingState::Disabled);
    rig.emulator.power_cycle(0);
    wait_for(&mut client, |state| !has(state, OperatingStateMsg::HOMED));
    let restarting = [Refusal::DrivesNotReady, Refusal::Busy, Refusal::InFault];
    for _ in 0..2000 {
        match client.state_command(StateCommand::Enable).unwrap_err() {
            ClientError::Refused { refusal, .. } if restarting.contains(&refusal) => {
                // A fault during the restart is acknowledged as an operator would.
                let _ = client.state_command(StateCommand::Acknowledge);
                clock::sleep(Nanos::from_millis(10));
            }
            ClientError::Refused { refusal, .. } => return assert_eq!(refusal, Refusal::NotHomed),
            error => panic!("{error}"),
        }
    }
    panic!("the drive does not restart");
}
