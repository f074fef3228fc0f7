//! H06: the encoder zero is lost.

use i2ris::clock;
use i2ris::ipc::client::ClientError;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;

use crate::bench::Bench;
use crate::rig::{Rig, has, settle_in, wait_for};

#[test]
fn h06_a_robot_that_loses_its_zero_holds_and_refuses_servo_commands() {
    let mut bench = Bench::moving();
    bench.drives[1].feedback.homed = false;
    bench.run(3);
    let before = bench.targets();
    assert!(bench.report().holding && !bench.report().homed);
    assert_eq!(bench.actuator(before), Refusal::NotHomed);
    bench.run(100);
    assert_eq!(bench.targets(), before);
    assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
    bench.idle();
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::NotHomed);
}

#[test]
fn h06_a_drive_that_lost_its_power_has_to_be_homed_again() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    client.state_command(StateCommand::Disable).unwrap();
    settle_in(&mut client, OperatingState::Disabled);
    rig.emulator.power_cycle(0);
    wait_for(&mut client, |state| !has(state, OperatingStateMsg::HOMED));
    let restarting = [Refusal::DrivesNotReady, Refusal::Busy, Refusal::State];
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
