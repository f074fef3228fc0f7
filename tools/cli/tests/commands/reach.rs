//! A reach-and-hold task on emulated drives: keys through a terminal, a recording, and its report.

use std::fs;

use i2ris::clock;
use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::ReachTarget;
use i2ris::units::Nanos;
use i2ris_testing::{Program, Terminal, home_and_enable};

use crate::live::Robot;

/// How long a task of two targets may take on a machine that does other things.
const PATIENCE: Nanos = Nanos::from_millis(240_000);

/// Plays the person: presses arrows towards the target until the task has ended.
fn reach_by_keys(client: &Client, terminal: &mut Terminal) {
    let mut target = Latest::new(client.watcher().reach_target());
    let mut measured = Latest::new(client.watcher().measured_js());
    let start = clock::now();
    while clock::now().since(start) < PATIENCE {
        clock::sleep(Nanos::from_millis(150));
        let mut keys = String::from(" ");
        if let (Some(target), Some(snake)) =
            (target.refresh().unwrap(), measured.refresh().unwrap())
        {
            if target.flags & ReachTarget::ENDED != 0 && target.number == target.total {
                return;
            }
            for (axis, [more, less]) in
                [["\x1b[A", "\x1b[B"], ["\x1b[C", "\x1b[D"]].iter().enumerate()
            {
                let away = (target.position[axis] - snake.position[axis]).to_degrees();
                let steps = (away.abs() / 0.1).round().min(3.0) as usize;
                keys.push_str(&if away > 0.0 { more } else { less }.repeat(steps));
            }
        }
        terminal.type_keys(&keys);
    }
    panic!("the task does not end:\n{}", terminal.screen.screen().contents());
}

#[test]
fn a_person_reaches_targets_with_keys_and_the_report_scores_the_recording() {
    let robot = Robot::start();
    let mut client = Client::connect(&robot.domain, Nanos::from_millis(60_000)).unwrap();
    home_and_enable(&mut client, Nanos::from_millis(60_000)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("task.mcap");
    let mut record = Program::start(&robot.domain, &["record", "--output", file.to_str().unwrap()]);
    while fs::metadata(&file).map_or(0, |data| data.len()) == 0 {
        assert!(record.child().try_wait().unwrap().is_none());
        clock::sleep(Nanos::from_millis(50));
    }
    let words = "command reach --targets 2 --seed 3 --range-deg 2 --hold-s 0.5 --limit-s 100";
    let words: Vec<&str> = words.split(' ').collect();
    let mut terminal = Terminal::start(&robot.domain, &words, 24, 80);
    terminal.wait_for("2 targets; close the clutch to begin");
    reach_by_keys(&client, &mut terminal);
    let shown = terminal.wait_for("2 of 2 targets held for 0.5 s within 0.15 deg; median time");
    assert!(shown.contains("target 1 of 2: held after"), "{shown}");
    assert!(terminal.end().success());
    terminal.assert_restored();

    // The recorder has everything that came before the signal.
    clock::sleep(Nanos::from_millis(500));
    record.interrupt();
    let (success, _, error) = record.end();
    assert!(success, "{error}");
    let (success, json, error) =
        Program::run(&robot.domain, &["report", file.to_str().unwrap(), "--json"]);
    assert!(success, "{error}");
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    let score = &report["targets"];
    assert_eq!((&score["by"], &score["held"]), (&"estimate".into(), &1.0.into()), "{score}");
    let targets = score["targets"].as_array().unwrap();
    assert_eq!(targets.len(), 2);
    for target in targets {
        assert!(target["held_s"].as_f64().unwrap() >= 0.5, "{target}");
        // Each is at least half the range from the one before.
        assert!(target["distance_deg"].as_f64().unwrap() > 0.8, "{target}");
    }
}

#[test]
fn a_task_without_a_terminal_and_without_targets_is_refused() {
    let robot = i2ris_testing::Controller::enabled();
    let (success, _, error) = Program::run(&robot.domain, &["command", "reach"]);
    assert!(!success && error.contains("needs a terminal"), "{error}");
    let words = ["command", "reach", "--targets", "0"];
    let (success, _, error) = Program::run(&robot.domain, &words);
    assert!(!success && error.contains("1..=1000"), "{error}");
}
