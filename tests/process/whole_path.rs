//! The whole path: client, shared memory, controller, serial lines, drives, snake.

use std::path::{Path, PathBuf};

use i2ris::drive::capture::file::CaptureFile;
use i2ris::drive::capture::{self, CapturedPort, LineEvent, Outcome};
use i2ris::drive::link::replay::replay as replay_line;
use i2ris::ipc::Fault;
use i2ris::process::black_box::{BlackBox, TickRecord, replay};
use i2ris_simulation::log::EventKind;
use i2ris_simulation::{Injection, Line};

use super::*;

#[test]
fn motors_follow_counts_and_the_snake_bends() {
    let mut rig = Rig::start();
    let client = rig.enabled();
    stream_counts(&client, 2.0, |t| [(300.0 * t).min(400.0) as i32, 0]);
    let [first, second] = rig.positions();
    assert!((first - 400).abs() <= 3 && second.abs() <= 3, "{first} {second}");
    let [pitch, yaw] = rig.emulator.snapshot().angles_deg;
    assert!(pitch.hypot(yaw) > 3.0, "400 counts bend the snake: {pitch} {yaw}");
    let log = rig.emulator.log();
    assert!(!log.iter().any(|event| matches!(event.kind, EventKind::HostBug(_))));
}

#[test]
fn three_axes_move_and_jaw_fault_stops_all() {
    let mut rig = Rig::with_model();
    let client = rig.enabled();
    let (mut commander, start) = (client.commander(), clock::now());
    let mut jaw = client.watcher().jaw_measured_js();
    let mut angle = f64::NAN;
    while (clock::now() - start).as_seconds() < 2.5 {
        let fraction = ((clock::now() - start).as_seconds() / 1.5).min(1.0);
        commander.servo_jp(&[0.05 * fraction, 0.0]).unwrap();
        commander.servo_jaw(0.2 * fraction).unwrap();
        if let Some(message) = jaw.newest().unwrap() {
            assert_eq!((message.count, message.flags), (1, JointState::VALID));
            angle = message.position[0];
        }
        clock::sleep(SEND_PERIOD);
    }
    assert!((angle - 0.2).abs() < 0.01, "{angle} rad");
    let counts = rig.emulator.snapshot().auxiliary.unwrap().position;
    assert!((f64::from(counts) - 20.0 * 0.2_f64.to_degrees()).abs() < 4.0, "{counts} counts");
    assert!(rig.positions().iter().any(|counts| counts.abs() > 20));
    // The line carries the quick stops, so some commands still arrive.
    rig.emulator.raise_fault(2, 0x2310, false);
    let mut client = client;
    let fault = wait_for(&mut client, |state| state.state == OperatingState::Fault.number());
    assert_eq!(fault.fault, Fault::Drive.number());
    wait_until("all stand", || {
        let axes = rig.emulator.snapshot().axes.map(|axis| axis.drive.state);
        axes.iter().all(|state| *state != State::OperationEnabled)
    });
    let log = rig.emulator.log();
    assert!(!log.iter().any(|event| matches!(event.kind, EventKind::HostBug(_))));
}

#[test]
fn silent_drives_at_shutdown_are_named_with_own_exit_code() {
    for is_in_fault in [false, true] {
        let mut rig = Rig::start();
        let mut client = rig.enabled();
        (0..2).for_each(|axis| rig.emulator.silence(axis, true));
        if is_in_fault {
            wait_for(&mut client, |state| state.state == OperatingState::Fault.number());
            // Their power-off cannot be confirmed.
            client.state_command(StateCommand::Disable).unwrap();
        }
        drop(client);
        rig.signal(Signal::SIGTERM);
        let (status, log) = (rig.wait_for_end(), rig.log_text("controller"));
        assert_eq!(status.code(), Some(8), "{log}");
        assert_eq!(log.matches("NOT known to be off").count(), 3, "{log}");
        assert!(log.contains("have not confirmed power-off: cut their power"), "{log}");
    }
}

#[test]
fn sigterm_and_sigint_shut_down_cleanly_with_exit_code_0() {
    for signal in [Signal::SIGTERM, Signal::SIGINT] {
        let mut rig = Rig::start();
        let client = rig.enabled();
        stream_counts(&client, 0.5, |t| [(400.0 * t) as i32, 0]);
        drop(client);
        rig.signal(signal);
        let (status, log) = (rig.wait_for_end(), rig.log_text("controller"));
        assert_eq!(status.code(), Some(0), "{log}");
        // Ready to switch on: the power stage is off.
        for (axis, state) in rig.emulator.snapshot().axes.iter().enumerate() {
            assert_eq!(state.drive.state, State::ReadyToSwitchOn, "axis {axis}: {log}");
        }
        // Operation was disabled before the power stage was switched off: no coasting.
        let events = rig.emulator.log().into_iter().filter(|event| event.axis == 0);
        let states: Vec<State> = events
            .filter_map(|event| match event.kind {
                EventKind::State { to, .. } => Some(to),
                _ => None,
            })
            .collect();
        let enabled = states.iter().rposition(|state| *state == State::OperationEnabled);
        assert_eq!(states.get(enabled.unwrap() + 1), Some(&State::SwitchedOn), "{states:?}");
        wait_until("no files are left", || files(&rig.domain()).is_empty());
    }
}

#[test]
fn silent_drive_is_named() {
    for (line, names) in [(Line::Lab, &["node 2", "axis0"][..]), (Line::Rs232, &["axis1"])] {
        let mut rig = Rig::on(line);
        rig.config.ports.iter_mut().for_each(|port| port.reply_timeout_ms = 200);
        rig.emulator.silence(1, true);
        let mut child = rig.spawn_controller("controller");
        assert_eq!(wait_for_end(&mut child).code(), Some(1));
        let text = rig.log_text("controller");
        let error = text.lines().last().unwrap();
        let is_named = names.iter().all(|name| error.contains(name));
        assert!(error.starts_with("error: ") && is_named, "{text}");
    }
}

#[test]
fn run_log_records_starts_ends_state_changes_and_commanding_client() {
    let mut rig = Rig::start();
    let runs = rig.folder.path().join("records/runs.jsonl");
    fs::create_dir(runs.parent().unwrap()).unwrap();
    fs::write(&runs, "{\"a line that a power cut").unwrap();
    for _ in 0..2 {
        let client = rig.enabled();
        stream_counts(&client, 0.3, |t| [(200.0 * t) as i32, 0]);
        rig.signal(Signal::SIGTERM);
        assert_eq!(rig.wait_for_end().code(), Some(0));
    }
    let text = fs::read_to_string(&runs).unwrap();
    let lines = text.lines().skip(1).map(|line| serde_json::from_str(line).unwrap());
    let lines: Vec<serde_json::Value> = lines.collect();
    let events = |name: &str| lines.iter().filter(|line| line["event"] == name).collect::<Vec<_>>();
    let begins = events("begin");
    assert_eq!((begins.len(), events("end").len()), (2, 2), "{text}");
    assert_ne!(begins[0]["run"], begins[1]["run"]);
    assert_eq!(begins[0]["config_sha256"].as_str().unwrap().len(), 64);
    let serial_number = rig.config.axis(1).unwrap().serial_number;
    assert_eq!(begins[0]["drives"][1]["serial_number"], serial_number);
    let states = events("state");
    let enabled = states.iter().filter(|line| line["to"] == "ENABLED");
    assert_eq!(enabled.filter(|line| line["command"] == "enable").count(), 2, "{text}");
    let ours = format!("process {}", std::process::id());
    let callers: Vec<_> = events("lease").iter().map(|line| line["caller"].to_string()).collect();
    assert!(callers.iter().any(|caller| caller.contains(&ours)), "{text}");
    assert!(rig.log_text("controller").contains(&ours));
}

/// The only record of a rig with this name ending.
fn record(rig: &Rig, end: &str) -> PathBuf {
    let entries = fs::read_dir(rig.folder.path().join("records")).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let paths: Vec<_> = paths.filter(|path| path.to_string_lossy().ends_with(end)).collect();
    assert_eq!(paths.len(), 1, "{paths:?}: {}", rig.log_text("controller"));
    paths[0].clone()
}

/// The only black box of a rig that was written for a cause.
fn black_box(rig: &Rig, cause: &str) -> BlackBox {
    BlackBox::read(&record(rig, &format!("-{cause}.box"))).unwrap()
}

/// The outcomes on every port in a capture, which replays to the same ones.
fn outcomes(path: &Path) -> Vec<Vec<Outcome>> {
    let CaptureFile { ports, is_whole } = capture::file::read(path).unwrap();
    assert!(is_whole);
    let outcomes = |port: &CapturedPort| {
        let replayed = replay_line(port);
        // The last attempt may not have ended.
        assert!(replayed.differences.is_empty() && replayed.skipped <= 1, "{replayed:?}");
        let outcomes = port.events.iter().filter_map(LineEvent::outcome);
        let outcomes: Vec<Outcome> = outcomes.collect();
        assert_eq!(outcomes.len() as u64, replayed.attempts);
        outcomes
    };
    ports.iter().map(outcomes).collect()
}

#[test]
fn black_boxes_of_every_cause_replay_bit_for_bit() {
    let mut rig = Rig::with_model();
    rig.config.limits.feedback_stale_ms = 1000;
    let mut client = rig.enabled();
    stream_counts(&client, 1.0, |t| [(300.0 * t) as i32, 0]);
    let path = client.write_black_box().unwrap();
    assert!(outcomes(&path.with_extension("pcapng")).iter().all(|port| port.len() > 200));
    let on_request = BlackBox::read(&path).unwrap();
    assert!(on_request.ticks.len() > 100, "{}", on_request.ticks.len());
    rig.emulator.mute(0, true);
    let fault = OperatingState::Fault;
    wait_for(&mut client, |state| state.state == fault.number());
    rig.emulator.mute(0, false);
    clock::sleep(Nanos::from_millis(1500));
    rig.signal(Signal::SIGTERM);
    assert_eq!(rig.wait_for_end().code(), Some(0), "{}", rig.log_text("controller"));
    let (on_fault, at_exit) = (black_box(&rig, "fault"), black_box(&rig, "exit"));
    for cause in ["fault", "exit"] {
        let ports = outcomes(&record(&rig, &format!("-{cause}.pcapng")));
        assert!(ports.iter().any(|port| port.contains(&Outcome::Timeout)));
    }
    let is_fault = |tick: &TickRecord| tick.outputs.report.state == fault;
    assert!(on_fault.ticks.iter().any(is_fault) && !on_fault.ticks.iter().all(is_fault));
    for black_box in [on_request, on_fault, at_exit] {
        let replayed = replay(&black_box).unwrap();
        assert!(replayed.difference.is_none() && replayed.skipped == 0, "{replayed:?}");
        assert_eq!(replayed.ticks, black_box.ticks.len() as u64);
    }
    assert!(rig.log_text("controller").contains("black box of"));
}

#[test]
fn the_last_seconds_before_sigkill_are_in_a_black_box() {
    let mut rig = Rig::with_model();
    let client = rig.enabled();
    stream_counts(&client, 1.5, |t| [(100.0 * t) as i32, 0]);
    drop(client);
    rig.signal(Signal::SIGKILL);
    rig.wait_for_end();
    // Until the emulated ports have noticed.
    clock::sleep(Nanos::from_millis(500));
    // Also if the next start fails.
    rig.config.ports[0].axes[1].serial_number += 10;
    assert_eq!(rig.spawn_controller("failed").wait().unwrap().code(), Some(1));
    let log = rig.log_text("failed");
    assert!(log.contains("the previous controller was killed"), "{log}");
    assert!(rig.domain().last_run().is_some(), "clients learn of the killed one");
    let found = black_box(&rig, "killed");
    assert!(found.ticks.len() > 500, "{}", found.ticks.len());
    let replayed = replay(&found).unwrap();
    assert_eq!((replayed.ticks, replayed.difference), (found.ticks.len() as u64, None));
    assert!(found.ticks.iter().any(|tick| tick.inputs.servo.is_some()), "the commands are in it");
}

#[test]
fn link_errors_are_published_as_health() {
    let mut rig = Rig::start();
    let client = rig.enabled();
    let mut health = client.watcher().health();
    let mut newest = |condition: &dyn Fn(&Health) -> bool| {
        wait_until("a record of health", || health.newest().unwrap().filter(condition))
    };
    let before = newest(&|_| true);
    assert!(before.stamp_ns <= clock::now().0);
    assert_eq!((before.ipc_failures, before.lost_replies), (0, 0));
    for _ in 0..3 {
        rig.emulator.inject(1, Injection::FlipReply { offset: 4 });
    }
    let errors = |health: &Health| {
        let counters =
            [health.crc_errors, health.timeouts, health.resynchronisations, health.retries];
        counters.iter().flatten().sum::<u64>()
    };
    assert!(newest(&|health| errors(health) > errors(&before)).sequence > before.sequence);
}

#[test]
fn the_log_is_published_line_by_line() {
    let mut rig = Rig::start();
    let client = rig.enabled();
    // A late client gets the last lines.
    let mut events = client.watcher().events();
    let mut lines = Vec::new();
    wait_until("the line of the change to ENABLED", || {
        events.drain(|event| lines.push(unpadded_text(&event.text))).unwrap();
        lines.iter().any(|line| line.contains("-> ENABLED")).then_some(())
    });
    let log = rig.log_text("controller");
    assert!(lines.iter().all(|line| log.contains(line)), "{lines:?}\n{log}");
}
