//! H02: the commander dies or stalls. The robot decelerates and holds within the deadline and two
//! ticks; the lease becomes free.

use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, OperatingState};
use i2ris::units::Nanos;
use i2ris_testing::{
    Rig, TIMEOUT, assert_stopped_within, settle, stream_counts, swing, wait_for, wait_until_holding,
};

/// A process that commands both motors until it is killed.
fn spawn_commander(domain: &str) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--ignored", "--exact", "hazards::h02::commander_process"]);
    command.env("RIG_DOMAIN", domain).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

/// Not a test of its own: the commander that other tests kill.
#[test]
#[ignore = "a role: run by another test"]
fn commander_process() {
    let Ok(domain) = std::env::var("RIG_DOMAIN") else {
        return;
    };
    let client = Client::connect(&Domain::new(&domain).unwrap(), TIMEOUT).unwrap();
    stream_counts(&client, 60.0, swing);
}

#[test]
fn h02_the_snake_holds_when_its_commander_is_killed() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    let mut commander = spawn_commander(&rig.config.domain);
    wait_for(&mut client, |state| state.accepted > 50);
    commander.kill().unwrap();
    let killed = clock::now();
    commander.wait().unwrap();
    let held = wait_until_holding(&mut client);
    assert_eq!(held.state, OperatingState::Enabled.number());
    assert!(held.stale_stops >= 1);
    let deadline = Nanos::from_millis(rig.config.command.deadline_ms + 250);
    assert_stopped_within(&rig, killed..killed + deadline);
    // The lease becomes free, so the next commander is not locked out.
    wait_for(&mut client, |state| state.lease_client_id == 0);
    let here = rig.positions();
    stream_counts(&client, 0.5, |_| here);
    let state = settle(&mut client, |state| state.lease_client_id != 0);
    assert!(state.accepted > held.accepted);
}
