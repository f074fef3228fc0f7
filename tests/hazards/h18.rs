//! H18: restart after kill -9. Leftovers are removed, clients find the new controller, and the zero
//! is still known.

use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, StateCommand};
use i2ris_testing::{Rig, enable, has, settle_in, stream_counts};
use nix::sys::signal::Signal;

#[test]
fn h18_a_killed_controller_is_restarted_and_continues_with_the_same_client_and_zero() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    for _ in 0..3 {
        rig.signal(Signal::SIGKILL);
        rig.wait_for_end();
        rig.start_controller();
        rig.client();
        let state = settle_in(&mut client, OperatingState::Disabled);
        assert!(has(&state, OperatingStateMsg::HOMED), "the drives kept their zero");
        enable(&mut client);
        stream_counts(&client, 0.3, |t| [(200.0 * t) as i32, 0]);
    }
    client.state_command(StateCommand::Disable).unwrap();
    settle_in(&mut client, OperatingState::Disabled);
}
