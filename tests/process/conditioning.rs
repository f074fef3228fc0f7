//! The command `condition`.

use i2ris::clock;
use i2ris::ipc::client::ClientError;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;
use i2ris_testing::{Rig, has, settle_in, wait_for, wait_until_idle};

fn is_busy(state: &OperatingStateMsg) -> bool {
    has(state, OperatingStateMsg::BUSY)
}

#[test]
fn the_motors_make_a_decaying_conditioning_cycle_and_end_where_they_began() {
    let mut rig = Rig::start();
    rig.config.compensation.conditioning_counts = Some(300);
    let mut client = rig.enabled();
    let begin = wait_until_idle(&mut client);
    client.state_command(StateCommand::Condition).unwrap();
    wait_for(&mut client, is_busy);
    let refusal = client.state_command(StateCommand::Condition).unwrap_err();
    let busy = Refusal::Conditioning;
    assert!(matches!(refusal, ClientError::Refused { refusal, .. } if refusal == busy));
    let mut commander = client.commander();
    let mut state = begin;
    while state.refused == begin.refused {
        commander.servo_actuators(&[0, 0]).unwrap();
        clock::sleep(Nanos::from_millis(5));
        state = client.operating_state().unwrap().unwrap();
        assert!(is_busy(&state), "{state:?}");
    }
    let end = settle_in(&mut client, OperatingState::Enabled);
    assert_eq!((end.last_refusal, end.lease_client_id), (busy.number(), 0));
    for (axis, position) in rig.positions().into_iter().enumerate() {
        let setpoints: Vec<i32> = rig.setpoints(axis).into_iter().map(|(_, c)| c).collect();
        let range = (setpoints.iter().min(), setpoints.iter().max());
        assert_eq!(range, (Some(&-300), Some(&300)), "axis {axis}");
        assert!(position.abs() <= 3, "axis {axis}: {position}");
    }
}

#[test]
fn pause_stops_the_conditioning_cycle() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    client.state_command(StateCommand::Condition).unwrap();
    wait_for(&mut client, is_busy);
    client.state_command(StateCommand::Pause).unwrap();
    settle_in(&mut client, OperatingState::Paused);
    let paused = rig.positions();
    client.state_command(StateCommand::Resume).unwrap();
    let state = settle_in(&mut client, OperatingState::Enabled);
    assert!(has(&state, OperatingStateMsg::HOLDING), "it does not continue by itself");
    for (before, after) in paused.into_iter().zip(rig.positions()) {
        assert!((before - after).abs() <= 3, "{before} {after}");
    }
}
