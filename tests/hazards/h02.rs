//! H02: the commander dies or stalls. The robot slows down and holds within the deadline and two
//! ticks; the lease falls free.

use std::process::{Command, Stdio};

use i2ris::clock;
use i2ris::ipc::OperatingState;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::units::Nanos;

use crate::bench::Bench;
use crate::live::stream_counts;
use crate::rig::{PATIENCE, Rig, settle};

/// Where the last motion is to the tick: counted time.
#[test]
fn h02_without_commands_the_set_points_stand_two_ticks_after_the_deadline() {
    let mut bench = Bench::moving();
    // The last command was sent one tick ago, and is 0 ms old in its own tick.
    let (sent, deadline) = (
        bench.out.requests[0].command_stamp,
        Nanos::from_millis(bench.config.command.deadline_ms),
    );
    assert!(sent > Nanos::ZERO);
    let (mut last_motion, mut before) = (bench.now, bench.targets());
    for _ in 0..200 {
        bench.tick();
        if bench.targets() != before {
            (last_motion, before) = (bench.now, bench.targets());
        }
    }
    let tick = bench.config.control.period();
    assert!(
        last_motion <= sent + deadline + tick + tick,
        "{} ms after the command",
        last_motion.since(sent).0 / 1_000_000
    );
    assert!(bench.report().holding && bench.report().stale_stops == 1);
    bench.run(500);
    assert_eq!(bench.report().lease_client_id, 0);
}

/// Not a test of its own: the commander that the next test kills.
#[test]
#[ignore = "run as a process by another test"]
fn commander_process() {
    let Ok(domain) = std::env::var("RIG_DOMAIN") else {
        return;
    };
    let client = Client::connect(&i2ris::ipc::Domain::new(&domain).unwrap(), PATIENCE).unwrap();
    stream_counts(&client, 60.0, |t| {
        [
            (600.0 * (t * 2.0).sin()) as i32,
            (600.0 * (t * 1.7).sin()) as i32,
        ]
    });
}

#[test]
fn h02_the_snake_holds_when_its_commander_is_killed() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    let mut commander = Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "h02::commander_process"])
        .env("RIG_DOMAIN", &rig.config.ipc.domain)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let moving = |state: &OperatingStateMsg| state.accepted > 50;
    client.wait_for(PATIENCE, moving).unwrap();
    commander.kill().unwrap();
    let killed = clock::now();
    commander.wait().unwrap();
    let held = client
        .wait_for(PATIENCE, |state| {
            state.flags & OperatingStateMsg::HOLDING != 0
        })
        .unwrap();
    assert_eq!(held.state, OperatingState::Enabled.number());
    assert!(held.stale_stops >= 1);
    // Half a second after the deadline nothing moves any more, however slow the machine is.
    clock::sleep(Nanos::from_millis(500));
    let quiet = killed + Nanos::from_millis(rig.config.command.deadline_ms + 250);
    for axis in 0..2 {
        let setpoints = rig.setpoints(axis);
        let before = setpoints
            .iter()
            .filter(|(stamp, _)| *stamp < killed)
            .map(|(_, counts)| counts);
        assert!(
            before.clone().max().unwrap() - before.min().unwrap() > 20,
            "it moved before"
        );
        let after: Vec<i32> = setpoints
            .iter()
            .filter(|(stamp, _)| *stamp > quiet)
            .map(|(_, counts)| *counts)
            .collect();
        assert!(after.len() > 5, "set-points are still sent");
        assert!(after.iter().all(|counts| counts == &after[0]), "{after:?}");
    }
    // The lease falls free, so the next commander is not locked out.
    client
        .wait_for(PATIENCE, |state| state.lease_client_id == 0)
        .unwrap();
    let here = rig.emulator.snapshot().axes.map(|axis| axis.drive.position);
    stream_counts(&client, 0.5, |_| here);
    assert!(settle(&mut client, |state| state.lease_client_id != 0).accepted > held.accepted);
}
