//! H06: the encoder zero is lost.

use i2ris::ipc::client::ClientError;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};

use crate::bench::Bench;
use crate::rig::{PATIENCE, Rig, settle};

#[test]
fn h06_a_robot_that_loses_its_zero_holds_and_takes_no_servo_commands() {
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
    settle(&mut client, |state| {
        state.state == OperatingState::Disabled.number()
    });
    rig.emulator.power_cycle(0);
    client
        .wait_for(PATIENCE, |state| {
            state.flags & OperatingStateMsg::HOMED == 0
        })
        .unwrap();
    let refused = (0..2000).find_map(|_| match client.state_command(StateCommand::Enable) {
        Err(ClientError::Refused {
            refusal: Refusal::DrivesNotReady | Refusal::Busy | Refusal::State,
            ..
        }) => {
            // It starts anew; a fault in between is acknowledged as an operator would.
            let _ = client.state_command(StateCommand::Acknowledge);
            i2ris::clock::sleep(i2ris::units::Nanos::from_millis(10));
            None
        }
        other => Some(other),
    });
    assert!(
        matches!(
            refused,
            Some(Err(ClientError::Refused {
                refusal: Refusal::NotHomed,
                ..
            }))
        ),
        "{refused:?}"
    );
}
