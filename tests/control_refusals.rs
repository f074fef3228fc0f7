//! What `i2ris-control` refuses to start with: one clear sentence, exit code 1, nothing left
//! behind.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn control(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_i2ris-control"))
        .args(arguments)
        .output()
        .unwrap()
}

/// Runs the controller on a configuration and returns its one line of complaint.
fn complaint(folder: &Path, config: &str) -> String {
    let file = folder.join("robot.toml");
    fs::write(&file, config).unwrap();
    let output = control(&["--config", file.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.starts_with("error: "), "{text}");
    text
}

fn config(extra: &str, device: &Path) -> String {
    let domain = format!(
        "refusals-{}-{:?}",
        std::process::id(),
        std::thread::current().id()
    );
    let domain: String = domain
        .chars()
        .filter(|c| c.is_ascii_alphanumeric() || *c == '-')
        .collect();
    format!(
        "robot_id = \"here\"\n{extra}\n[ipc]\ndomain = \"{domain}\"\n[[ports]]\ndevice = \"{}\"\n\
         [[ports.axes]]\nmotor = 0\nnode_id = 0\nserial_number = 1\nposition_min_counts = -100\n\
         position_max_counts = 100\n",
        device.display()
    )
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let absent = folder.path().join("no-such-port");
    (folder, absent)
}

/// A one-motor model file of a given robot and schema.
fn model(robot_id: &str, schema_version: u32) -> String {
    format!(
        r#"{{"format": "i2ris-model", "schema_version": {schema_version}, "robot_id": "{robot_id}",
            "outputs": [{{"name": "pitch", "unit": "deg"}}],
            "family": {{"kind": "linear", "gain": [[0.02]], "offset": [0.0], "covariance": [[0.01]]}},
            "hull": {{"corners": [[-100.0], [100.0]]}},
            "training": {{"data_file": "x.csv", "data_sha256": "{}", "rows": 10, "seed": 0, "restarts": 0,
                "log_likelihood": null, "bic": null, "software": "test"}},
            "metrics": [{{"training": {{"r2": 1.0, "rmsd": 0.1, "nrmsd": 0.01, "mae": 0.1, "max": 0.2}},
                "held_out": null}}]}}"#,
        "0".repeat(64)
    )
}

#[test]
fn no_configuration_named() {
    let output = control(&[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8(output.stderr).unwrap().contains("--help"));
}

#[test]
fn configuration_that_does_not_exist() {
    let output = control(&["--config", "no/such/file.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(
        text.contains("no/such/file.toml") && text.lines().count() == 1,
        "{text}"
    );
}

#[test]
fn unknown_key() {
    let (folder, absent) = folder();
    let text = complaint(folder.path(), &config("[control]\nrate = 1000", &absent));
    assert!(
        text.contains("robot.toml")
            && text.contains("unknown field `rate`")
            && text.contains("line 3"),
        "{text}"
    );
}

#[test]
fn value_out_of_range() {
    let (folder, absent) = folder();
    let text = complaint(folder.path(), &config("[control]\nrate_hz = 20", &absent));
    assert!(
        text.contains("control.rate_hz = 20: must be 100 to 4000"),
        "{text}"
    );
}

#[test]
fn port_that_does_not_exist() {
    let (folder, absent) = folder();
    let text = complaint(folder.path(), &config("", &absent));
    assert!(text.contains("no-such-port"), "{text}");
}

#[test]
fn model_that_does_not_exist() {
    let (folder, absent) = folder();
    let text = complaint(
        folder.path(),
        &config("[control]\nmodel = \"gone.json\"", &absent),
    );
    assert!(text.contains("gone.json"), "{text}");
}

#[test]
fn model_of_another_robot() {
    let (folder, absent) = folder();
    fs::write(folder.path().join("model.json"), model("elsewhere", 1)).unwrap();
    let text = complaint(
        folder.path(),
        &config("[control]\nmodel = \"model.json\"", &absent),
    );
    assert!(
        text.contains("elsewhere") && text.contains("here"),
        "{text}"
    );
}

#[test]
fn model_of_another_schema() {
    let (folder, absent) = folder();
    fs::write(folder.path().join("model.json"), model("here", 99)).unwrap();
    let text = complaint(
        folder.path(),
        &config("[control]\nmodel = \"model.json\"", &absent),
    );
    assert!(text.contains("99"), "{text}");
}

#[test]
fn files_that_everyone_may_write() {
    let (folder, absent) = folder();
    let all = || std::os::unix::fs::PermissionsExt::from_mode(0o666);
    let path = folder.path().join("model.json");
    fs::write(&path, model("here", 1)).unwrap();
    fs::set_permissions(&path, all()).unwrap();
    let text = complaint(
        folder.path(),
        &config("[control]\nmodel = \"model.json\"", &absent),
    );
    assert!(
        text.contains("model.json") && text.contains("chmod o-w"),
        "{text}"
    );
    fs::set_permissions(folder.path().join("robot.toml"), all()).unwrap();
    let text = complaint(folder.path(), &config("", &absent));
    assert!(
        text.contains("robot.toml") && text.contains("chmod o-w"),
        "{text}"
    );
}
