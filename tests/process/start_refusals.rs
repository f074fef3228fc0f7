//! `i2ris-control` and `i2ris-watchdog` refuse to start with a reason and the matching exit code.

use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use i2ris::drive::capture;
use i2ris_needs::needs;
use tempfile::TempDir;

use super::*;

/// Runs the controller and returns its one line of standard error.
fn refusal(code: i32, arguments: &[&str]) -> String {
    refusal_by(env!("CARGO_BIN_EXE_i2ris-control"), code, arguments)
}

fn refusal_by(program: &str, code: i32, arguments: &[&str]) -> String {
    let mut command = Command::new(program);
    let output = command.args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{output:?}");
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.starts_with("error: "), "{text}");
    text
}

/// Writes `robot.toml` and a model file, and returns the refusal of the controller.
fn refusal_of(code: i32, folder: &Path, table: &str, model: &str) -> String {
    let (file, device) = (folder.join("robot.toml"), folder.join("no-such-port"));
    let config = format!(
        "robot_id = \"here\"\ndomain = \"r{:016x}\"\n{table}\n[[ports]]\ndevice = \"{}\"\n\
         [[ports.axes]]\nmotor = 0\nnode_id = 0\nserial_number = 1\nposition_min_counts = -100\n\
         position_max_counts = 100\n",
        random_id(),
        device.display()
    );
    fs::write(&file, config).unwrap();
    fs::write(folder.join("model.json"), model).unwrap();
    refusal(code, &["--config", file.to_str().unwrap()])
}

/// A one-motor model file of a given robot and schema.
fn model(robot_id: &str, schema_version: u32) -> String {
    format!(
        r#"{{"format": "i2ris-model", "schema_version": {schema_version}, "robot_id": "{robot_id}",
            "outputs": [{{"name": "pitch", "unit": "deg"}}],
            "family": {{"kind": "linear", "gain": [[0.02]], "offset": [0.0],
                "covariance": [[0.01]]}},
            "hull": {{"corners": [[-100.0], [100.0]]}},
            "training": {{"data_file": "x.csv", "data_sha256": "{}", "rows": 10, "seed": 0,
                "restarts": 0, "log_likelihood": null, "bic": null, "software": "test"}},
            "metrics": [{{"training": {{"r2": 1.0, "rmsd": 0.1, "nrmsd": 0.01, "mae": 0.1,
                "max": 0.2}}, "held_out": null}}]}}"#,
        "0".repeat(64)
    )
}

const WITH_MODEL: &str = "[control]\nmodel = \"model.json\"";

/// ZoneMinder#1924, eclipse-iceoryx/iceoryx#2287: using memory that does not exist raises SIGBUS.
#[needs("user namespaces")]
#[test]
fn too_small_shared_memory_is_refused_with_required_size() {
    let folder = TempDir::new().unwrap();
    let _ = refusal_of(1, folder.path(), "", "");
    for size in ["256k", "4m"] {
        let script = format!(
            "mount -t tmpfs -o size={size} tmpfs /dev/shm && exec {} --config {}",
            env!("CARGO_BIN_EXE_i2ris-control"),
            folder.path().join("robot.toml").display()
        );
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount", "sh", "-c", &script]);
        let output = command.output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(text.contains("MB free, and 32 MB are needed"), "{size}: {output:?}");
    }
}

#[test]
fn watchdog_and_controller_have_the_same_exit_codes() {
    let folder = tempfile::tempdir().unwrap();
    let wrong = folder.path().join("robot.toml");
    fs::write(&wrong, "robot_id = 1\n").unwrap();
    for program in [env!("CARGO_BIN_EXE_i2ris-control"), env!("CARGO_BIN_EXE_i2ris-watchdog")] {
        assert!(refusal_by(program, 2, &[]).contains("--help"));
        let text = refusal_by(program, 6, &["--config", "no/such/file.toml"]);
        assert!(text.contains("no/such/file.toml") && text.lines().count() == 1, "{text}");
        let text = refusal_by(program, 6, &["--config", wrong.to_str().unwrap()]);
        assert!(text.contains("robot.toml is not valid"), "{text}");
    }
}

#[test]
fn wrong_configuration_port_or_model_is_refused_with_reason() {
    let (here, elsewhere, newer) = (model("here", 1), model("elsewhere", 1), model("here", 99));
    for (table, model, reasons) in [
        ("[control]\nrate = 1000", "", &["robot.toml", "unknown field `rate`", "line 4"][..]),
        ("[control]\nrate_hz = 20", "", &["control.rate_hz = 20: must be 100 to 4000"]),
        ("", "", &["no-such-port"]),
        (WITH_MODEL, &here, &["no-such-port"]),
        ("[control]\nmodel = \"gone.json\"", "", &["gone.json"]),
        (WITH_MODEL, &elsewhere, &["model.json", "elsewhere", "here"]),
        (WITH_MODEL, &newer, &["99"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let is_config = reasons.iter().any(|reason| reason.contains("rate"));
        let code = if is_config { 6 } else { 1 };
        let text = refusal_of(code, folder.path(), table, model);
        for reason in reasons {
            assert!(text.contains(reason), "{reason}: {text}");
        }
    }
}

#[test]
fn failed_start_keeps_one_serial_capture() {
    let mut rig = Rig::start();
    rig.config.ports[0].axes[1].serial_number += 10;
    let file = rig.folder.path().join(&rig.config.record_folder).join("failed-start.pcapng");
    for _ in 0..2 {
        let ended = rig.spawn_controller("failed").wait().unwrap();
        assert_eq!(ended.code(), Some(1), "{}", rig.log_text("failed"));
        let log = rig.log_text("failed");
        assert!(log.contains(&format!("failed start: {}", file.display())), "{log}");
        let kept = capture::file::read(&file).unwrap();
        assert!(kept.ports[0].attempts().len() > 10, "{kept:?}");
    }
}

#[test]
fn files_that_everyone_may_write_are_refused() {
    let folder: TempDir = tempfile::tempdir().unwrap();
    let path = |name| folder.path().join(name);
    for (name, table, code) in [("model.json", WITH_MODEL, 1), ("robot.toml", "", 6)] {
        // The files exist, so writing them below keeps their permissions.
        fs::write(path(name), "").unwrap();
        fs::set_permissions(path(name), fs::Permissions::from_mode(0o666)).unwrap();
        let text = refusal_of(code, folder.path(), table, &model("here", 1));
        assert!(text.contains(name) && text.contains("chmod o-w"), "{text}");
    }
}
