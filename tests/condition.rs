//! The command `condition` against real processes: controller, serial lines, drives, snake.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod rig;

use i2ris::clock;
use i2ris::ipc::client::ClientError;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;
use rig::{PATIENCE, Rig, settle};

#[test]
fn the_motors_go_through_a_decaying_stroke_and_end_where_they_began() {
    let mut rig = Rig::new();
    rig.config.conditioning.half_width_counts = Some(300);
    rig.config.conditioning.turns = 2;
    let mut client = rig.enabled();
    let begin = settle(&mut client, |_| true);
    client.state_command(StateCommand::Condition).unwrap();
    client
        .wait_for(PATIENCE, |state| state.flags & OperatingStateMsg::BUSY != 0)
        .unwrap();
    let again = client.state_command(StateCommand::Condition);
    assert!(
        matches!(
            again,
            Err(ClientError::Refused {
                refusal: Refusal::Busy,
                ..
            })
        ),
        "{again:?}"
    );
    let mut commander = client.commander();
    let mut state = begin;
    while state.refused == begin.refused {
        commander.servo_actuators(&[0, 0]).unwrap();
        clock::sleep(Nanos::from_millis(5));
        state = client.operating_state().unwrap().unwrap();
        assert!(state.flags & OperatingStateMsg::BUSY != 0, "{state:?}");
    }
    let end = settle(&mut client, |_| true);
    assert_eq!(end.state, OperatingState::Enabled.number());
    assert_eq!(
        (end.last_refusal, end.lease_client_id),
        (Refusal::Busy.number(), 0)
    );
    for (axis, state) in rig.emulator.snapshot().axes.iter().enumerate() {
        let setpoints = || rig.setpoints(axis).into_iter().map(|(_, counts)| counts);
        assert_eq!(
            (setpoints().min(), setpoints().max()),
            (Some(-300), Some(300)),
            "axis {axis}"
        );
        assert!(state.drive.position.abs() <= 3, "{state:?}");
    }
}

#[test]
fn pause_stops_the_stroke() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    client.state_command(StateCommand::Condition).unwrap();
    client
        .wait_for(PATIENCE, |state| state.flags & OperatingStateMsg::BUSY != 0)
        .unwrap();
    client.state_command(StateCommand::Pause).unwrap();
    settle(&mut client, |state| {
        state.state == OperatingState::Paused.number()
    });
    let paused = rig.emulator.snapshot().axes.map(|axis| axis.drive.position);
    client.state_command(StateCommand::Resume).unwrap();
    let state = settle(&mut client, |state| {
        state.state == OperatingState::Enabled.number()
    });
    assert!(
        state.flags & OperatingStateMsg::HOLDING != 0,
        "it does not go on by itself"
    );
    let resumed = rig.emulator.snapshot().axes.map(|axis| axis.drive.position);
    for (before, after) in paused.iter().zip(resumed) {
        assert!((before - after).abs() <= 3, "{paused:?} {resumed:?}");
    }
}
