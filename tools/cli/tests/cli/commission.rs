//! `i2ris commission` at a terminal. Drives and motors are tested in simulated time, in
//! `tools/cli/src/commission`; here the operator is: typing ahead, leaving, coming back.

use std::fs;

use i2ris::config::{Config, HomingMethod};
use i2ris::{clock, ipc::Domain};
use i2ris_simulation::Line;
use i2ris_testing::{Program, Rig, Terminal, bench::assert_says, wait_until};
use nix::sys::signal::{Signal, kill};
use serde_json::{Value, json};

/// A commissioning at a terminal, to which each question that comes is answered.
fn at_terminal(domain: &Domain, words: &[&str], answers: &[(&str, &str)]) -> Terminal {
    let mut terminal = Terminal::start(domain, words, 70, 120);
    for (question, answer) in answers {
        terminal.wait_for(question);
        terminal.type_keys(answer);
    }
    terminal
}

fn is_powered(rig: &Rig) -> bool {
    let seen = rig.emulator.snapshot();
    let drives = seen.axes.map(|axis| axis.drive).into_iter().chain(seen.auxiliary);
    drives.into_iter().any(|drive| drive.state.is_powered())
}

#[test]
fn interrupted_commissioning_resumes_with_drives_off() {
    let mut rig = Rig::on(Line::Rs232);
    let (folder, domain) = (rig.folder.path().to_owned(), rig.domain());
    let config = folder.join("commissioned.toml");
    fs::write(&config, toml::to_string(&rig.config).unwrap()).unwrap();
    let result = folder.join("result");
    let words = ["commission", "--config", config.to_str().unwrap(), "--folder"];
    let words = [&words[..], &[result.to_str().unwrap()]].concat();
    let (_, _, error) = Program::run(&domain, &words);
    assert_says(&error, &["run it on a terminal"]);

    let begin = clock::now();
    // Input typed before the question permits nothing.
    for (typed, last) in [("yes\nyes\n", "2 of 7"), ("yes\n", "2 of 7"), ("no\n", "not permitted")]
    {
        let mut terminal = at_terminal(&domain, &words, &[("1 of 7: identify", typed)]);
        terminal.wait_for(last);
        if last == "2 of 7" {
            terminal.type_keys(if typed == "yes\n" { "\x04" } else { "\x03" });
            terminal.wait_for(if typed == "yes\n" { "end of input" } else { "interrupted" });
        }
        terminal.wait_for("page: ");
        assert!(!terminal.end().success());
        assert!(!is_powered(&rig) && !rig.moved_since(begin));
    }
    let stages = ["1 of 7", "2 of 7", "3 of 7"].map(|stage| (stage, "yes\n"));
    let mut terminal = at_terminal(&domain, &words, &stages);
    wait_until("a drive has power", || is_powered(&rig));
    terminal.type_keys("\x03");
    terminal.wait_for("stage power: interrupted; the drives are off");
    assert!(!terminal.end().success() && !is_powered(&rig));
    let text = fs::read_to_string(result.join("commission.json")).unwrap();
    let record: Value = serde_json::from_str(&text).unwrap();
    let stages = record["stages"].as_array().unwrap().iter();
    let stages: Vec<_> = stages.map(|it| (&it["stage"], &it["outcome"])).collect();
    let expected = [("identify", "done"), ("settings", "done"), ("power", "left")];
    let mut pairs = stages.iter().zip(expected);
    assert!(pairs.all(|(is, it)| (is.0, is.1) == (&it.0.into(), &it.1.into())));
    assert_eq!(stages.len(), 3, "{stages:?}");
    assert!(result.join("settings.pcapng").exists() && result.join("commission.html").exists());

    rig.start_controller();
    let mut terminal = at_terminal(&domain, &words, &[("1 of 7: identify", "yes\n")]);
    terminal.wait_for("in use by another program");
    assert!(!terminal.end().success());
}

#[test]
fn confirmed_findings_are_written_and_the_old_file_kept() {
    let mut rig = Rig::start();
    rig.config.ports[0].axes[1].serial_number = 0;
    let [config, result] = ["day.toml", "result"].map(|name| rig.folder.path().join(name));
    let old = toml::to_string(&rig.config).unwrap();
    fs::write(&config, &old).unwrap();
    let [file, folder] = [&config, &result].map(|path| path.to_str().unwrap());
    let words = ["commission", "--apply", "--config", file, "--folder", folder];
    for word in ["no", "apply"] {
        let typed = format!("{word}\n");
        let answers = [("1 of 7: identify", "yes\n"), ("Type apply", typed.as_str())];
        let mut terminal = at_terminal(&rig.domain(), &words, &answers);
        assert!(!terminal.end().success());
        assert_eq!(fs::read_to_string(&config).unwrap() == old, word == "no");
    }
    assert_eq!(Config::load(&config).unwrap().ports[0].axes[1].serial_number, 62_000_002);
    assert_eq!(fs::read_to_string(config.with_extension("toml.1")).unwrap(), old);
}

/// A robot whose commissioning has reached a stage, and the words that resume it there.
fn at_stage(rig: &Rig, next: usize) -> Vec<String> {
    let (config, result) = (rig.folder.path().join("day.toml"), rig.folder.path().join("result"));
    let text = toml::to_string(&rig.config).unwrap();
    fs::write(&config, &text).unwrap();
    fs::create_dir(&result).unwrap();
    let names = ["identify", "settings", "power", "steps", "gear", "exchanges", "stops"];
    let done = |stage| json!({ "stage": stage, "outcome": "done", "at": "", "text": "" });
    let stages: Vec<Value> = names.iter().take(next - 1).map(done).collect();
    let record = json!({
        "robot_id": "rig", "software": "", "config": text, "stages": stages, "findings": [],
        "differences": [], "exchanges": [], "sweeps": [], "changes": []
    });
    fs::write(result.join("commission.json"), record.to_string()).unwrap();
    let [config, result] = [config, result].map(|path| path.to_str().unwrap().to_owned());
    ["commission".to_owned(), "--config".to_owned(), config, "--folder".to_owned(), result].into()
}

/// Motor positions, counts, independent of the zero.
fn motors(rig: &Rig) -> Vec<f64> {
    let seen = rig.emulator.snapshot();
    let axes = seen.axes.map(|axis| axis.drive.motor_counts);
    axes.into_iter().chain(seen.auxiliary.map(|drive| drive.motor_counts)).collect()
}

fn farthest(now: &[f64], before: &[f64]) -> f64 {
    now.iter().zip(before).map(|(now, before)| (now - before).abs()).fold(0.0, f64::max)
}

#[test]
fn killed_or_suspended_commissioning_leaves_drives_without_power() {
    for signal in [Signal::SIGKILL, Signal::SIGSTOP] {
        let rig = Rig::start();
        let words = at_stage(&rig, 4);
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let stages = ["1 of 7", "4 of 7"].map(|stage| (stage, "yes\n"));
        let mut terminal = at_terminal(&rig.domain(), &words, &stages);
        let before = motors(&rig);
        wait_until("a pulse turns a motor", || farthest(&motors(&rig), &before) > 0.5);
        kill(terminal.pid(), signal).unwrap();
        wait_until("no drive has power", || !is_powered(&rig));
        let now = motors(&rig);
        assert!(farthest(&now, &before) < 100.0, "{signal}: from {before:?} to {now:?}");
        kill(terminal.pid(), Signal::SIGCONT).unwrap();
        assert!(!terminal.end().success() && !is_powered(&rig), "{signal}");
        let dump = ["doctor", "drives", "--config", words[2]];
        let (is_free, _, error) = Program::run(&rig.domain(), &dump);
        assert!(is_free, "{signal}: {error}");
    }
}

#[test]
fn h12_no_motor_moves_when_a_controller_dies_at_any_homing() {
    let mut rig = Rig::start();
    let methods = [HomingMethod::StopPositive, HomingMethod::StopNegative, HomingMethod::Here];
    for (axis, homing) in rig.config.ports.iter_mut().flat_map(|it| &mut it.axes).zip(methods) {
        axis.homing = homing;
    }
    let words = at_stage(&rig, 7);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let before = motors(&rig);
    let stages = ["1 of 7", "7 of 7"].map(|stage| (stage, "yes\n"));
    let tests = [("THE CABLE", "no\n"), ("THE CONTROLLER", "kill\n"), ("THE SUPPLY", "no\n")];
    let mut terminal = at_terminal(&rig.domain(), &words, &[&stages[..], &tests].concat());
    terminal.wait_for("every drive is stopped by the watchdog");
    assert!(terminal.end().success() && !is_powered(&rig));
    let now = motors(&rig);
    assert!(farthest(&now, &before) < 3.0, "from {before:?} to {now:?}");
}
