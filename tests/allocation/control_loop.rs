//! The loop around the cycle and the threads of the ports do not allocate: those of a whole
//! controller in this process, with emulated drives and clients in shared memory.

use std::thread;

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::Client;
use i2ris::units::Nanos;
use i2ris_testing::{Rig, TIMEOUT, home_and_enable, stream_angles, wait_until_idle};

use crate::calls_in_real_time;

/// Long enough for a snapshot for the black box, which is taken once per second.
const MOTION: f64 = 1.5;

fn use_robot(client: &mut Client) {
    stream_angles(client, |t| (t < MOTION).then(|| [3.0 * t.sin(), -3.0 * t.sin()]));
    for command in [
        StateCommand::Pause,
        StateCommand::Resume,
        StateCommand::Hold,
        StateCommand::Release,
        StateCommand::Condition,
    ] {
        client.state_command(command).unwrap();
        clock::sleep(Nanos::from_millis(100));
    }
    assert!(client.state_command(StateCommand::Home).is_err(), "refused");
    client.state_command(StateCommand::Disable).unwrap();
    wait_until_idle(client);
    client.state_command(StateCommand::Unhome).unwrap();
}

#[test]
fn running_controller_does_not_allocate_in_loop_or_ports() {
    let mut rig = Rig::with_model();
    rig.start_controller_thread();
    let mut client = rig.client();
    home_and_enable(&mut client, TIMEOUT).unwrap();
    assert_eq!(calls_in_real_time(|| use_robot(&mut client)), 0);
}

#[test]
fn calls_of_threads_with_these_names_are_counted() {
    for name in ["control", "port"] {
        let calls = calls_in_real_time(|| {
            let named = thread::Builder::new().name(name.to_owned());
            let work = || drop(std::hint::black_box(Vec::<u8>::with_capacity(10)));
            named.spawn(work).unwrap().join().unwrap();
        });
        assert!(calls >= 2, "{name}: {calls}");
    }
}
