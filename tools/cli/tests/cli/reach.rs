//! A reach-and-hold task on emulated drives: keys through a terminal, a recording, and its report.

use std::fs;

use i2ris::ipc::client::{Client, Latest};
use i2ris::{clock, ipc::Domain, ipc::payload::ReachTarget, units::Nanos};
use i2ris_testing::bench::{WorkFolder, assert_says, fails, interrupt, robot, start};
use i2ris_testing::{Controller, Program, TIMEOUT, Terminal, home_and_enable, wait_until};

/// Time limit of a task of two targets on a shared machine.
const PATIENCE: Nanos = Nanos::from_millis(240_000);

fn record(bench: &WorkFolder, domain: &Domain) -> Program {
    let record = start(domain, &bench.words("record --output @task.mcap"));
    let size = || fs::metadata(bench.path("task.mcap")).map_or(0, |data| data.len());
    wait_until("it records", || size() > 0);
    record
}

fn report(bench: &WorkFolder, record: Program) -> (String, serde_json::Value) {
    // The recorder has everything from before the signal.
    clock::sleep(Nanos::from_millis(500));
    interrupt(record);
    let json = bench.succeeds("record report task.mcap --json");
    (bench.succeeds("record report task.mcap"), serde_json::from_str(&json).unwrap())
}

/// Plays the operator: presses arrows towards the target until the task ends.
fn reach_by_keys(client: &Client, terminal: &mut Terminal) {
    let mut target = Latest::new(client.watcher().reach_target());
    let mut measured = Latest::new(client.watcher().measured_js());
    let start = clock::now();
    while clock::now().duration_since(start) < PATIENCE {
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
fn targets_are_reached_with_keys_and_scored_by_report() {
    // Away from the camera, so the estimate judges.
    let (rig, mut client) = robot(|rig| {
        let domain = rig.another_domain("blind");
        domain.name().clone_into(&mut rig.config.domain);
    });
    let domain = rig.domain();
    home_and_enable(&mut client, TIMEOUT).unwrap();
    let bench = WorkFolder::empty();
    let record = record(&bench, &domain);
    let words =
        "teleop task reach --targets 2 --seed 3 --range-deg 2 --hold-s 0.5 --duration-s 100";
    let words: Vec<&str> = words.split(' ').collect();
    let mut terminal = Terminal::start(&domain, &words, 24, 80);
    terminal.wait_for("2 targets; close the clutch to begin");
    reach_by_keys(&client, &mut terminal);
    let shown = terminal.wait_for("2 of 2 targets held for 0.5 s within 0.15 deg; median time");
    assert_says(&shown, &["target 1 of 2: held after"]);
    assert!(terminal.end().success());
    terminal.assert_restored();

    let (_, report) = report(&bench, record);
    let score = &report["targets"];
    assert_eq!((&score["by"], &score["held"]), (&"estimate".into(), &1.0.into()), "{score}");
    let targets = score["targets"].as_array().unwrap();
    assert_eq!(targets.len(), 2);
    for target in targets {
        assert!(target["held_s"].as_f64().unwrap() >= 0.5, "{target}");
        // Each is at least half the range from the previous one.
        assert!(target["distance_deg"].as_f64().unwrap() > 0.8, "{target}");
    }
}

#[test]
fn target_is_followed_with_keys_and_scored_by_report() {
    for (words, moves, lag) in
        [("pursuit --seed 2", true, "pursuit"), ("hold-still", false, "held")]
    {
        let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
        let record = record(&bench, &controller.domain);
        let words = format!("teleop task {words} --duration-s 6");
        let words: Vec<&str> = words.split(' ').collect();
        let mut terminal = Terminal::start(&controller.domain, &words, 24, 80);
        terminal.wait_for("close the clutch to begin");
        let client = Client::connect(&controller.domain, TIMEOUT).unwrap();
        let mut target = Latest::new(client.watcher().reach_target());
        wait_until("the task is over", || {
            terminal.type_keys(" ");
            clock::sleep(Nanos::from_millis(100));
            let target = target.refresh().unwrap();
            target.is_some_and(|target| target.flags & ReachTarget::ENDED != 0)
        });
        terminal.wait_for("deg from the target (root mean square)");
        assert!(terminal.end().success());
        let (text, report) = report(&bench, record);
        assert_says(&text, &[lag, "from the target by the estimate"]);
        let pursuits = report["pursuits"].as_array().unwrap();
        assert_eq!((pursuits.len(), &pursuits[0]["moves"]), (1, &moves.into()), "{report}");
        assert!(report["targets"].is_null(), "nothing was to be reached");
    }
}

#[test]
fn a_task_without_a_terminal_and_without_targets_is_refused() {
    let controller = Controller::enabled();
    fails(&controller.domain, "teleop task reach", 1, &["needs a terminal"]);
    fails(&controller.domain, "teleop task reach --targets 0", 2, &["1..=1000"]);
    for words in ["pursuit --targets 5", "hold-still --hold-s 1", "hold-still --seed 2"] {
        fails(&controller.domain, &format!("teleop task {words}"), 2, &["--"]);
    }
}
