//! Interfaces for scripts, shells, editors and systemd: exit codes, closed readers, JSON,
//! completions, units.

use std::fs;
use std::process::{Command, Stdio};

use i2ris::ipc::{Domain, Fault, OperatingState, Refusal};
use i2ris_needs::needs;
use i2ris_testing::bench::{WorkFolder, assert_says, repository, run};
use i2ris_testing::cycle::balance_model;
use i2ris_testing::{Controller, program, unique_domain};

fn code(domain: &Domain, words: &str) -> Option<i32> {
    let result = run(domain, words);
    let is_silent = result.error.is_empty();
    assert!(
        result.code == Some(0) || !is_silent,
        "{words} fails without a word: {}",
        result.output
    );
    result.code
}

#[test]
fn the_exit_code_reports_what_kind_of_failure_it_was() {
    let unused = unique_domain();
    let controller = Controller::start();
    let domain = &controller.domain;
    for (domain, words, expected) in [
        (&unused, "--completions bash", 0),
        (&unused, "command", 2),
        (&unused, "model show", 3),
        (domain, "command pose", 4),
    ] {
        assert_eq!(code(domain, words), Some(expected), "{words}");
    }
    controller.robot().state = OperatingState::Enabled;
    controller.robot().homed = true;
    controller.robot().refuse = Some(Refusal::Range);
    assert_eq!(code(domain, "command pose 1 1"), Some(4), "every command refused");
    controller.robot().fault = Fault::Drive;
    controller.robot().state = OperatingState::Fault;
    assert_eq!(code(domain, "command pose"), Some(5));
}

/// A full disk, a limit on the size of files, and a terminal that was closed.
#[test]
fn output_that_goes_nowhere_ends_in_order_and_is_said() {
    let config = repository("config/robot.toml");
    let print =
        format!("{} doctor config --all {}", program::path("i2ris").display(), config.display());
    let bench = WorkFolder::empty();
    let printed = fs::File::create(bench.file("printed")).unwrap();
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let closed = nix::pty::openpty(None, None).unwrap().slave;
    for (output, code, result) in [
        (Stdio::from(full), 1, "No space left on device"),
        (Stdio::from(printed), 1, "File too large"),
        (Stdio::from(closed), 130, "Input/output error"),
    ] {
        let mut command = Command::new("sh");
        command.args(["-c", &format!("ulimit -f 1; exec {print}")]).stdout(output);
        let ended = command.stderr(Stdio::piped()).spawn().unwrap().wait_with_output().unwrap();
        let error = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(code), "{result}: {error}");
        assert!(error.contains(result) && !error.contains("panicked"), "{error}");
    }
}

/// `| head -0`: the output is not read.
#[test]
fn closed_reader_is_not_an_error() {
    let config = repository("config/robot.toml");
    let config = config.to_str().unwrap();
    for arguments in [
        &["doctor", "config", "schema"][..],
        &["doctor", "config", "print", config],
        &["--completions", "zsh"],
        &["doctor", "--config", config, "--no-drives"],
    ] {
        let mut child = program::command(arguments)
            .env("I2RIS_DOMAIN", unique_domain().name())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr);
        let panicked = error.contains("panic") || output.status.code() == Some(101);
        assert!(!panicked, "{arguments:?}: {error}");
    }
}

#[test]
fn schema_covers_every_table_and_is_valid_for_editors() {
    let text = fs::read_to_string(repository("config/schema/controller.json")).unwrap();
    let schema: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(schema["$schema"].as_str().unwrap().contains("json-schema.org"));
    for table in ["control", "command", "limits", "compensation", "virtual_fixtures", "ports"] {
        assert!(schema["properties"][table]["description"].is_string(), "{table}");
    }
    assert_eq!(schema["required"], serde_json::json!(["robot_id", "ports"]));
}

/// Gaps of 60 counts and friction that stretches the wires by 20 to either side: 100 counts, from
/// rest to rest at 500 counts/s and 5000 counts/s^2. A motor moves the tip by 0.022 deg a count.
#[test]
fn configuration_with_a_model_reports_permitted_hand_motion() {
    let config = fs::read_to_string(repository("config/emulator.toml")).unwrap();
    let config = config.replace("\"i2ris-emulated\"", "\"bench\"");
    let bench = WorkFolder::empty();
    balance_model().file().write(&bench.path("model.json")).unwrap();
    let model = "priority = 80\nmodel = \"model.json\"";
    bench.write("robot.toml", &config.replace("priority = 80", model));
    let output = bench.succeeds("doctor config robot.toml");
    let hand = "a reversal takes 300 ms; a hand of up to 11.0 deg/s is followed";
    assert_says(&output, &[hand]);
    let slow = format!("{config}\n[joint_limits]\nvelocity_deg_s = 4.0");
    bench.write("robot.toml", &slow.replace("priority = 80", model));
    assert_says(&bench.succeeds("doctor config robot.toml"), &["of up to 4.0 deg/s"]);
}

/// The units, with the programs of this build instead of the installed ones.
#[needs("program: systemd-analyze")]
#[test]
fn the_units_of_systemd_are_valid() {
    let bench = WorkFolder::empty();
    let units = ["i2ris-control@.service", "i2ris-watchdog@.service"].map(|name| {
        let text = fs::read_to_string(repository("config/system").join(name)).unwrap();
        assert!(text.contains("ExecStart=/usr/local/bin/i2ris-"), "{name}");
        let program = text.lines().find_map(|line| line.strip_prefix("ExecStart=")).unwrap();
        let installed = program.split(' ').next().unwrap();
        bench.write(name, &text.replace(installed, env!("CARGO_BIN_EXE_i2ris")));
        bench.path(name)
    });
    let output = Command::new("systemd-analyze").arg("verify").args(&units).output().unwrap();
    let result = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    let ours: Vec<&str> = result.lines().filter(|line| line.contains("i2ris")).collect();
    assert!(ours.is_empty(), "{ours:?}");
}
