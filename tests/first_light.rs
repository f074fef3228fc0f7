//! The whole path: client -> shared memory -> controller -> serial lines -> drives -> snake, with
//! real processes.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod rig;

use std::fs;
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::OperatingState;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::JointState;
use i2ris::process::black_box::{Content, TickRecord, replay};
use i2ris::units::Nanos;
use i2ris_emulator::drive::State;
use i2ris_emulator::log::EventKind;
use nix::sys::signal::Signal;
use rig::{PATIENCE, Rig, wait_for_end};

/// Set-points that tests send are this far apart.
const SEND_PERIOD: Nanos = Nanos::from_millis(5);

/// Sends a motion of the motors for a while.
fn stream_counts(client: &Client, seconds: f64, counts: impl Fn(f64) -> [i32; 2]) {
    let (mut commander, start) = (client.commander(), clock::now());
    while (clock::now() - start).as_seconds() < seconds {
        let now = clock::now();
        commander
            .servo_actuators(&counts((now - start).as_seconds()))
            .unwrap();
        clock::sleep_until(now + SEND_PERIOD);
    }
}

/// A linear model of the emulated snake, good to a few degrees: 0.022 degrees per count, axes
/// turned by 45 degrees.
fn rough_model() -> String {
    let g = 0.022 * std::f64::consts::FRAC_1_SQRT_2;
    let zero = r#"{"training": {"r2": 1.0, "rmsd": 1.0, "nrmsd": 0.1, "mae": 1.0, "max": 2.0}, "held_out": null}"#;
    format!(
        r#"{{"format": "i2ris-model", "schema_version": 1, "robot_id": "rig",
            "outputs": [{{"name": "pitch", "unit": "deg"}}, {{"name": "yaw", "unit": "deg"}}],
            "family": {{"kind": "linear", "gain": [[{g}, {minus}], [{g}, {g}]], "offset": [0.0, 0.0],
                "covariance": [[1.0, 0.0], [0.0, 1.0]]}},
            "hull": {{"corners": [[-1000.0, -1000.0], [1000.0, -1000.0], [1000.0, 1000.0], [-1000.0, 1000.0]]}},
            "training": {{"data_file": "none", "data_sha256": "{sha}", "rows": 10, "seed": 0, "restarts": 0,
                "log_likelihood": null, "bic": null, "software": "test"}},
            "metrics": [{zero}, {zero}]}}"#,
        minus = -g,
        sha = "0".repeat(64)
    )
}

#[test]
fn motors_follow_counts_and_the_snake_bends() {
    let mut rig = Rig::new();
    let client = rig.enabled();
    stream_counts(&client, 2.0, |t| [(300.0 * t).min(400.0) as i32, 0]);
    let snapshot = rig.emulator.snapshot();
    assert!(
        (snapshot.axes[0].drive.position - 400).abs() <= 3,
        "{snapshot:?}"
    );
    assert!(snapshot.axes[1].drive.position.abs() <= 3, "{snapshot:?}");
    let [pitch, yaw] = snapshot.angles_deg;
    assert!(
        pitch.hypot(yaw) > 3.0,
        "400 counts bend the snake by several degrees: {snapshot:?}"
    );
    let bugs = rig
        .emulator
        .log()
        .into_iter()
        .filter(|event| matches!(event.kind, EventKind::HostBug(_)))
        .count();
    assert_eq!(bugs, 0);
}

#[test]
fn angles_commanded_by_a_client_are_reached() {
    let mut rig = Rig::new();
    fs::write(rig.folder.path().join("model.json"), rough_model()).unwrap();
    rig.config.control.model = Some("model.json".into());
    let client = rig.enabled();
    let (mut commander, start) = (client.commander(), clock::now());
    let mut measured = client.watcher().measured_js();
    let mut last = JointState::default();
    while (clock::now() - start).as_seconds() < 2.0 {
        let share = ((clock::now() - start).as_seconds() / 1.5).min(1.0);
        commander
            .servo_jp(&[(6.0 * share).to_radians(), (-4.0 * share).to_radians()])
            .unwrap();
        if let Some(newest) = measured.newest().unwrap() {
            last = newest;
        }
        clock::sleep(SEND_PERIOD);
    }
    assert!(last.flags & JointState::VALID != 0);
    // The estimate from the encoders goes where it was asked; the snake itself only as well as a
    // rough model knows it.
    assert!(
        (last.position[0].to_degrees() - 6.0).abs() < 0.1,
        "{last:?}"
    );
    assert!(
        (last.position[1].to_degrees() + 4.0).abs() < 0.1,
        "{last:?}"
    );
    let [pitch, yaw] = rig.emulator.snapshot().angles_deg;
    assert!((pitch - 6.0).hypot(yaw + 4.0) < 5.0, "{pitch} {yaw}");
}

#[test]
fn sigterm_and_sigint_stop_in_order_with_exit_code_0() {
    for signal in [Signal::SIGTERM, Signal::SIGINT] {
        let mut rig = Rig::new();
        let client = rig.enabled();
        stream_counts(&client, 0.5, |t| [(400.0 * t) as i32, 0]);
        rig.signal(signal);
        assert_eq!(
            rig.wait_for_end().code(),
            Some(0),
            "{}",
            rig.said("controller")
        );
        // Ready to switch on: the power stage is off.
        let snapshot = rig.emulator.snapshot();
        for (axis, state) in snapshot.axes.iter().enumerate() {
            assert_eq!(
                state.drive.state,
                State::ReadyToSwitchOn,
                "axis {axis}: {}",
                rig.said("controller")
            );
        }
        // Operation was disabled before the power stage was switched off: no coasting.
        let states: Vec<State> = rig
            .emulator
            .log()
            .into_iter()
            .filter_map(|event| match event.kind {
                EventKind::State { to, .. } if event.axis == 0 => Some(to),
                _ => None,
            })
            .collect();
        let enabled = states
            .iter()
            .rposition(|state| *state == State::OperationEnabled)
            .unwrap();
        assert_eq!(
            states.get(enabled + 1),
            Some(&State::SwitchedOn),
            "{states:?}"
        );
    }
}

#[test]
fn a_drive_that_does_not_answer_is_named() {
    let mut rig = Rig::new();
    rig.config.ports[1].reply_timeout_ms = 50;
    rig.emulator.mute(1, true);
    let mut child = rig.spawn_controller("controller");
    let status = wait_for_end(&mut child).expect("it gives up");
    assert_eq!(status.code(), Some(1));
    let text = rig.said("controller");
    let complaint = text.lines().last().unwrap();
    assert!(
        complaint.starts_with("error: ") && complaint.contains("axis1"),
        "{text}"
    );
}

#[test]
fn nothing_is_left_in_shared_memory_after_a_clean_end() {
    let mut rig = Rig::new();
    rig.start_controller();
    rig.client();
    let (directory, prefix) = (
        rig.domain().directory().to_owned(),
        rig.domain().prefix().to_owned(),
    );
    rig.signal(Signal::SIGTERM);
    assert_eq!(rig.wait_for_end().code(), Some(0));
    std::thread::sleep(Duration::from_millis(100));
    assert!(!directory.exists());
    let left = fs::read_dir("/dev/shm").unwrap().filter_map(Result::ok);
    let left: Vec<_> = left
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn every_run_is_logged_with_what_it_ran_on_and_every_change_of_state_and_who_commanded() {
    let mut rig = Rig::new();
    for _ in 0..2 {
        let client = rig.enabled();
        stream_counts(&client, 0.3, |t| [(200.0 * t) as i32, 0]);
        rig.signal(Signal::SIGTERM);
        assert_eq!(rig.wait_for_end().code(), Some(0));
    }
    let text = fs::read_to_string(rig.folder.path().join("records/runs.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let of = |event: &str| {
        lines
            .iter()
            .filter(|line| line["event"] == event)
            .collect::<Vec<_>>()
    };
    let begins = of("begin");
    assert_eq!((begins.len(), of("end").len()), (2, 2), "{text}");
    assert_ne!(begins[0]["run"], begins[1]["run"]);
    assert_eq!(begins[0]["config_sha256"].as_str().unwrap().len(), 64);
    assert_eq!(
        begins[0]["drives"][1]["serial_number"],
        rig.config.ports[1].axes[0].serial_number
    );
    let enabled =
        |line: &&&serde_json::Value| line["to"] == "ENABLED" && line["command"] == "enable";
    assert_eq!(of("state").iter().filter(enabled).count(), 2, "{text}");
    let leases = of("lease");
    let ours = format!("process {}", std::process::id());
    assert!(
        leases.iter().any(|line| line["caller"]
            .as_str()
            .is_some_and(|caller| caller.contains(&ours))),
        "{text}"
    );
    assert!(rig.said("controller").contains(&ours));
}

/// The black boxes of a rig, by what they were written for.
fn black_boxes(rig: &Rig, cause: &str) -> Vec<Content> {
    let folder = rig.folder.path().join("records");
    let files = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let of_cause =
        |path: &std::path::PathBuf| path.to_string_lossy().ends_with(&format!("-{cause}.box"));
    files
        .filter(of_cause)
        .map(|path| BlackBox::read(&path).unwrap())
        .collect()
}

#[test]
fn the_black_box_is_written_on_request_on_a_fault_and_at_the_end_and_replays_to_the_bit() {
    let mut rig = Rig::new();
    fs::write(rig.folder.path().join("model.json"), rough_model()).unwrap();
    rig.config.control.model = Some("model.json".into());
    rig.config.limits.feedback_stale_ms = 1000;
    rig.config.limits.feedback_lost_ms = 2000;
    let mut client = rig.enabled();
    stream_counts(&client, 1.0, |t| [(300.0 * t) as i32, 0]);
    let file = client.write_black_box().unwrap();
    let content = BlackBox::read(&file).unwrap();
    assert!(content.ticks.len() > 100, "{}", content.ticks.len());
    rig.emulator.mute(0, true);
    client
        .wait_for(PATIENCE, |state| {
            state.state == OperatingState::Fault.number()
        })
        .unwrap();
    rig.emulator.mute(0, false);
    clock::sleep(Nanos::from_millis(1500));
    rig.signal(Signal::SIGTERM);
    assert_eq!(
        rig.wait_for_end().code(),
        Some(0),
        "{}",
        rig.said("controller")
    );
    let of_fault = black_boxes(&rig, "fault");
    let at_exit = black_boxes(&rig, "exit");
    assert_eq!(
        (of_fault.len(), at_exit.len()),
        (1, 1),
        "{}",
        rig.said("controller")
    );
    let faulty = |tick: &TickRecord| tick.outputs.report.state == OperatingState::Fault;
    assert!(of_fault[0].ticks.iter().any(faulty) && !of_fault[0].ticks.iter().all(faulty));
    for content in [content].iter().chain(&of_fault).chain(&at_exit) {
        let replayed = replay(content).unwrap();
        assert_eq!(
            (replayed.difference.clone(), replayed.skipped),
            (None, 0),
            "{replayed:?}"
        );
        assert_eq!(replayed.ticks, content.ticks.len() as u64);
    }
    assert!(rig.said("controller").contains("black box of"));
}
