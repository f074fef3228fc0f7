//! What scripts rely on: exit codes, readers that go away, JSON.

use std::path::Path;
use std::process::Stdio;

use i2ris::ipc::{Domain, Fault, OperatingState, Refusal, random_id};

use i2ris_testing::{Controller, Program, program};

fn code(domain: &Domain, arguments: &[&str]) -> Option<i32> {
    let (code, output, error) = Program::start(domain, arguments).code();
    assert!(code == Some(0) || !error.is_empty(), "{arguments:?} fails without a word: {output}");
    code
}

#[test]
fn the_exit_code_tells_what_kind_of_failure_it_was() {
    let nobody = Domain::new(&format!("t{:016x}", random_id())).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad.toml");
    std::fs::write(&bad, "robot_id = 3").unwrap();
    let controller = Controller::start();
    let domain = &controller.domain;
    assert_eq!(code(&nobody, &["completions", "bash"]), Some(0));
    assert_eq!(code(&nobody, &["model", "show", "/nonexistent.json"]), Some(1));
    assert_eq!(code(&nobody, &["nonsense"]), Some(2));
    assert_eq!(code(&nobody, &["command"]), Some(2));
    assert_eq!(code(&nobody, &["command", "hold"]), Some(3));
    assert_eq!(code(&nobody, &["model", "list"]), Some(3));
    assert_eq!(code(domain, &["command", "state", "enable"]), Some(4), "not homed");
    assert_eq!(code(domain, &["command", "hold"]), Some(4), "not enabled");
    assert_eq!(code(domain, &["config", "check", bad.to_str().unwrap()]), Some(6));
    controller.robot().state = OperatingState::Enabled;
    controller.robot().homed = true;
    controller.robot().refuse = Some(Refusal::Range);
    assert_eq!(code(domain, &["command", "pose", "1", "1"]), Some(4), "every command refused");
    controller.robot().fault = Fault::Drive;
    controller.robot().state = OperatingState::Fault;
    assert_eq!(code(domain, &["command", "hold"]), Some(5));
}

#[test]
fn the_help_tells_every_exit_code() {
    let (code, help, _) = Program::start(&Domain::new("nobody").unwrap(), &["--help"]).code();
    assert_eq!(code, Some(0));
    for number in ["0 ", "1 ", "2 ", "3 ", "4 ", "5 ", "6 ", "130 "] {
        assert!(help.lines().any(|line| line.trim_start().starts_with(number)), "{number}: {help}");
    }
}

/// `| head -0`: nobody reads any of it.
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/robot.toml");
    let config = config.to_str().unwrap();
    let nobody = format!("t{:016x}", random_id());
    for arguments in [
        &["config", "schema"][..],
        &["config", "print", config],
        &["completions", "zsh"],
        &["doctor", "--config", config, "--no-drives"],
    ] {
        let mut child = program::command(arguments)
            .env("I2RIS_DOMAIN", &nobody)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(
            !error.contains("panic") && output.status.code() != Some(101),
            "{arguments:?}: {error}"
        );
    }
}

#[test]
fn a_change_of_state_is_told_to_scripts() {
    let controller = Controller::start();
    let (code, output, error) =
        Program::start(&controller.domain, &["command", "state", "home", "--json"]).code();
    assert_eq!(code, Some(0), "{error}");
    let printed: serde_json::Value = serde_json::from_str(&output).unwrap();
    assert_eq!(
        (printed["accepted"].as_str(), printed["state"].as_str()),
        (Some("home"), Some("DISABLED"))
    );
}

#[test]
fn the_schema_knows_every_table_and_an_editor_can_read_it() {
    let (code, output, error) =
        Program::start(&Domain::new("nobody").unwrap(), &["config", "schema"]).code();
    assert_eq!(code, Some(0), "{error}");
    let schema: serde_json::Value = serde_json::from_str(&output).unwrap();
    assert!(schema["$schema"].as_str().unwrap().contains("json-schema.org"));
    for table in ["control", "ipc", "command", "limits", "compensation", "record", "ports"] {
        assert!(schema["properties"][table]["description"].is_string(), "{table}");
    }
    assert_eq!(schema["required"], serde_json::json!(["robot_id", "ports"]));
}
