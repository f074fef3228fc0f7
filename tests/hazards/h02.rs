//! H02: the commander dies or stalls. The robot decelerates and holds within the deadline and two
//! ticks; the lease becomes free.

use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, OperatingState};
use i2ris::units::Nanos;

use crate::bench::Bench;
use crate::rig::motion::{assert_stopped_within, stream_counts, swing};
use crate::rig::{Rig, TIMEOUT, settle, wait_for, wait_until_holding};

/// The last motion, to the tick: counted time.
#[test]
fn h02_without_commands_the_setpoints_are_constant_two_ticks_after_the_deadline() {
    let mut bench = Bench::moving();
    let deadline = Nanos::from_millis(bench.config.command.deadline_ms);
    let sent = bench.out.requests[0].command_stamp;
    assert!(sent > Nanos::ZERO);
    let (mut last_motion, mut before) = (bench.now, bench.targets());
    for _ in 0..200 {
        bench.tick();
        if bench.targets() != before {
            (last_motion, before) = (bench.now, bench.targets());
        }
    }
    let tick = bench.config.control.period();
    let ms = last_motion.since(sent).0 / 1_000_000;
    assert!(last_motion <= sent + deadline + tick + tick, "{ms} ms after the command");
    assert!(bench.report().holding && bench.report().stale_stops == 1);
    bench.run(500);
    assert_eq!(bench.report().lease_client_id, 0);
}

/// A process that commands both motors until it is killed.
pub fn spawn_commander(domain: &str) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--ignored", "--exact", "h02::commander_process"]);
    command.env("RIG_DOMAIN", domain).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

/// Not a test of its own: the commander that other tests kill.
#[test]
#[ignore = "run as a process by another test"]
fn commander_process() {
    let Ok(domain) = std::env::var("RIG_DOMAIN") else {
        return;
    };
    let client = Client::connect(&Domain::new(&domain).unwrap(), TIMEOUT).unwrap();
    stream_counts(&client, 60.0, swing);
}

#[test]
fn h02_the_snake_holds_when_its_commander_is_killed() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    let mut commander = spawn_commander(&rig.config.ipc.domain);
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
