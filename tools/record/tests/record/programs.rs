//! `i2ris record` and `i2ris record report` against a controller without drives.

use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::VirtualFixturesMsg;
use i2ris::model::ModelId;
use i2ris::model::file::ModelFile;
use i2ris::process::robot_description;
use i2ris::units::Nanos;
use i2ris_testing::{Controller, Program, Rig, program, wait_until};
use tempfile::TempDir;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn name(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn examination_path() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trial.mcap");
    (folder, file)
}

/// Waits until a file has some size.
fn wait_for_size(file: &Path, bytes: u64) {
    wait_until("the file grows", || fs::metadata(file).map_or(0, |data| data.len()) >= bytes);
}

/// Records into a file; success and standard error.
fn record(controller: &Controller, file: &Path, options: &[&str]) -> (bool, String) {
    let arguments = [&["record", "--output", name(file)], options].concat();
    let (success, _, error) = Program::run(&controller.domain, &arguments);
    (success, error)
}

/// The controller publishes robot and limits of this configuration.
pub fn runs_with(controller: &Controller, config: &Path) {
    controller.robot().description = robot_description(&Config::load(config).unwrap());
}

/// Runs a program; success, standard output and standard error.
fn run(arguments: &[&str]) -> (bool, String, String) {
    let output = program::output(arguments);
    (output.status.success(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_recording_has_every_stream_and_is_exported() {
    let controller = Controller::enabled();
    controller.robot().fixtures = Some(VirtualFixturesMsg {
        active: 3,
        limited_by: 2,
        values: [[0.125; 17]; 8],
        ..VirtualFixturesMsg::default()
    });
    let (folder, file) = examination_path();
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/emulator.toml");
    runs_with(&controller, &config);
    let options = ["--duration-s", "1.5", "--config", name(&config), "--json"];
    let arguments = [&["record", "--output", name(&file)], options.as_slice()].concat();
    let (success, output, error) = Program::run(&controller.domain, &arguments);
    assert!(success, "{error}");
    let report: serde_json::Value = serde_json::from_str(&output).unwrap();
    assert_eq!(report["dropped"].as_u64(), Some(0), "{output}");
    assert!(report["missed"].is_u64(), "{output}");
    let messages = report["messages"]["measured_js"].as_u64().unwrap();
    assert!(messages > 100, "{output}");

    let (success, info, error) = run(&["record", "info", name(&file)]);
    assert!(success, "{error}");
    for part in [
        "i2ris.header",
        "robot_id: i2ris-emulated",
        "i2ris.outcome",
        "attached emulator.toml",
        "/measured_js",
        "/i2ris/goal_js",
        "recorded 20",
    ] {
        assert!(info.contains(part), "{part}\n{info}");
    }
    let (success, json, error) = run(&["record", "info", name(&file), "--json"]);
    assert!(success, "{error}");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["metadata"]["i2ris.header"]["robot_id"], "i2ris-emulated");
    assert_eq!(json["topics"]["/i2ris/measured_js"]["messages"], messages);
    let read = program::example("read_recording", &[name(&file)]);
    assert!(read.starts_with(&format!("{messages} samples\npitch: ")), "{read}");
    assert!(json["recorded"][0].as_str().unwrap().ends_with('Z'), "{json}");
    let tables = folder.path().join("tables");
    let export = ["record", "export", name(&file), "--output", name(&tables)];
    assert!(run(&export).0);
    let table = fs::read_to_string(tables.join("measured_js.csv")).unwrap();
    let units = fs::read_to_string(tables.join("units.csv")).unwrap();
    assert!(units.contains("measured_js,yaw_velocity_deg_s,deg/s"), "{units}");
    let header = "time,t_s,received_s,sequence,stamp_ns,boot_id,pitch_deg,yaw_deg";
    assert!(table.starts_with(header), "{table}");
    let rows = table.lines().skip(1).map(|line| line.split(',').collect());
    let rows: Vec<Vec<&str>> = rows.collect();
    assert_eq!(rows.len() as u64, messages);
    let degrees = |row: &Vec<&str>| row[6].parse::<f64>().unwrap();
    assert!(rows.iter().all(|row| (degrees(row) - 1.0).abs() < 1e-9));
    let sequence = |row: &Vec<&str>| row[3].parse::<u64>().unwrap();
    assert!(rows.windows(2).all(|pair| sequence(&pair[0]) < sequence(&pair[1])));
    let table = fs::read_to_string(tables.join("virtual_fixtures.csv")).unwrap();
    let mut rows = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = rows.next().unwrap();
    let place = |name: &str| names.iter().position(|it| *it == name).unwrap();
    let row = rows.next().unwrap();
    for (name, wanted) in [("active", "3"), ("limited_by", "2"), ("values_135", "0.125")] {
        assert_eq!(row[place(name)], wanted, "{name}");
    }
}

#[test]
fn what_was_written_before_kill_9_is_recovered() {
    let controller = Controller::enabled();
    let (folder, file) = examination_path();
    let killed = ["record", "--output", name(&file), "--note", "killed"];
    let mut program = Program::start(&controller.domain, &killed);
    wait_for_size(&file, 100_000);
    program.child().kill().unwrap();
    program.end();
    assert!(!run(&["record", "info", name(&file)]).0, "a truncated file is an error");
    let whole = folder.path().join("whole.mcap");
    let (success, output, _) = run(&["record", "recover", name(&file), "--output", name(&whole)]);
    assert!(success && output.contains("1 metadata records"), "{output}");
    let (success, info, _) = run(&["record", "info", name(&whole)]);
    assert!(success && info.contains("note: killed"), "{info}");
}

#[test]
fn full_disk_ends_the_recording_and_keeps_written_data() {
    let controller = Controller::enabled();
    let (folder, file) = examination_path();
    let domain = ["--duration-s", "30", "--domain", controller.domain.name()];
    let record = [&["record", "--output", name(&file)], &domain[..]].concat();
    let output = with_full_disk(&record, 60_000);
    let error = text(&output.stderr);
    assert!(
        !output.status.success() && error.contains("trial.mcap") && error.contains("recover"),
        "{error}"
    );
    // The limit on the size of a file, which replaces the full disk here.
    assert!(error.contains("File too large"), "{error}");
    let whole = folder.path().join("whole.mcap");
    let (success, output, _) = run(&["record", "recover", name(&file), "--output", name(&whole)]);
    assert!(success && !output.contains("recovered 0"), "{output}");
}

#[test]
fn two_recorders_are_independent_and_never_share_a_file() {
    let controller = Controller::enabled();
    let (folder, file) = examination_path();
    let arguments = |file| ["record", "--output", file, "--duration-s", "1"];
    let first = Program::start(&controller.domain, &arguments(name(&file)));
    wait_for_size(&file, 1);
    let (success, error) = record(&controller, &file, &["--duration-s", "1"]);
    assert!(!success && error.contains("does not exist yet"), "{error}");
    let other = folder.path().join("other.mcap");
    let (success, error) = record(&controller, &other, &["--duration-s", "1"]);
    assert!(success, "{error}");
    assert!(first.end().0);
    assert!([&file, &other].iter().all(|file| run(&["record", "info", name(file)]).0));
}

/// Limits the size of files that a program and its children write, like a full disk.
pub fn limit_files(command: &mut Command, bytes: u64) {
    // SAFETY: both calls are async-signal-safe and touch no memory of the parent.
    unsafe {
        command.pre_exec(move || {
            use nix::sys::signal::{SigHandler, Signal, signal};
            signal(Signal::SIGXFSZ, SigHandler::SigIgn)?;
            let limit = nix::libc::rlimit { rlim_cur: bytes, rlim_max: bytes };
            nix::errno::Errno::result(nix::libc::setrlimit(nix::libc::RLIMIT_FSIZE, &limit))?;
            Ok(())
        });
    }
}

fn with_full_disk(arguments: &[&str], bytes: u64) -> Output {
    let mut command = program::command(arguments);
    command.stdin(Stdio::null());
    limit_files(&mut command, bytes);
    command.output().unwrap()
}

#[test]
fn report_accepts_complete_and_truncated_recordings() {
    let controller = Controller::enabled();
    let (folder, file) = examination_path();
    let options = ["--duration-s", "1", "--note", "a <short> one"];
    let (success, error) = record(&controller, &file, &options);
    assert!(success, "{error}");
    let (success, _, error) = run(&["record", "report", name(&file)]);
    assert!(success, "{error}");
    let page = fs::read_to_string(folder.path().join("trial.html")).unwrap();
    assert!(page.contains("a &lt;short&gt; one") && page.contains("<svg"), "{page}");
    assert!(!page.contains("<script"), "{page}");
    let (_, output, _) = run(&["record", "report", name(&file), "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&output).unwrap();
    assert!(summary["estimate"]["samples"].as_u64().unwrap() > 50, "{summary}");
    let rms = summary["estimate"]["length_rms_deg"].as_f64().unwrap();
    assert!(rms < 1e-9, "this robot follows at once: {rms}");
    assert!(summary["events"][0]["what"].as_str().unwrap().contains("ENABLED"), "{summary}");

    let cut = folder.path().join("cut.mcap");
    let bytes = fs::read(&file).unwrap();
    fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let (success, output, error) = run(&["record", "report", name(&cut)]);
    assert!(!success && error.contains("not complete") && output.contains("written"), "{error}");
    fs::write(&cut, "no recording at all, whatever its name says").unwrap();
    let (success, _, error) = run(&["record", "report", name(&cut)]);
    assert!(!success && error.contains("cut.mcap"), "{error}");
}

#[test]
fn reports_and_tables_fail_with_a_reason_on_full_disk() {
    let controller = Controller::enabled();
    let (folder, file) = examination_path();
    let (success, error) = record(&controller, &file, &["--duration-s", "1"]);
    assert!(success, "{error}");
    let tables = folder.path().join("tables");
    let export = ["record", "export", name(&file), "--output", name(&tables)];
    let output = with_full_disk(&export, 5000);
    let error = text(&output.stderr);
    assert!(!output.status.success() && error.contains("cannot write"), "{error}");
    assert!(error.contains("csv"), "{error}");
    let output = with_full_disk(&["record", "report", name(&file)], 5000);
    let error = text(&output.stderr);
    assert!(!output.status.success() && error.contains("trial.html"), "{error}");
    assert!(!folder.path().join("trial.html").exists(), "there must be no incomplete page");
}

#[test]
fn recording_contains_the_run_log_of_this_run() {
    let controller = Controller::enabled();
    let (folder, file) = examination_path();
    let config = folder.path().join("robot.toml");
    let emulator = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/emulator.toml");
    let content = fs::read_to_string(emulator).unwrap().replace("../target/records", "records");
    fs::write(&config, content).unwrap();
    let mut client = Client::connect(&controller.domain, Nanos::from_millis(5000)).unwrap();
    let run_id = format!("{:016x}", client.version().unwrap().boot_id);
    fs::create_dir(folder.path().join("records")).unwrap();
    let log = format!(
        "{{\"run\":\"{run_id}\",\"event\":\"begin\",\"software\":\"x\"}}\n\
         {{\"run\":\"0123\",\"event\":\"begin\"}}\n"
    );
    fs::write(folder.path().join("records/runs.jsonl"), log).unwrap();
    runs_with(&controller, &config);
    let options = ["--duration-s", "0.5", "--config", name(&config)];
    let (success, error) = record(&controller, &file, &options);
    assert!(success, "{error}");
    let (_, info, _) = run(&["record", "info", name(&file)]);
    assert!(info.contains("attached audit-begin.jsonl"), "{info}");
    assert!(info.contains("attached audit.jsonl"), "{info}");
    let bytes = fs::read(&file).unwrap();
    let contains = |word: &str| bytes.windows(word.len()).any(|window| window == word.as_bytes());
    assert!(contains("\"software\":\"x\"") && !contains("\"run\":\"0123\""));
}

#[test]
fn files_that_cannot_be_created_are_refused_first() {
    let controller = Controller::enabled();
    // /proc is read-only for everyone, root included.
    for path in ["/nonexistent/folder/trial.mcap", "/proc/trial.mcap"] {
        let (success, error) = record(&controller, Path::new(path), &[]);
        assert!(!success && error.contains(&format!("cannot create {path}")), "{error}");
    }
}

/// A model file that is valid, as far as a recorder looks.
fn model_file(robot_id: &str) -> String {
    let metrics = serde_json::json!({
        "training": { "r2": 1.0, "rmsd": 1.0, "nrmsd": 0.1, "mae": 1.0, "max": 2.0 },
        "held_out": null,
    });
    serde_json::json!({
        "format": "i2ris-model", "schema_version": 1, "robot_id": robot_id,
        "outputs": [{ "name": "pitch", "unit": "deg" }, { "name": "yaw", "unit": "deg" }],
        "family": {
            "kind": "linear", "gain": [[0.01, -0.01], [0.01, 0.01]], "offset": [0.0, 0.0],
            "covariance": [[1.0, 0.0], [0.0, 1.0]],
        },
        "hull": { "corners": [
            [-1000.0, -1000.0], [1000.0, -1000.0], [1000.0, 1000.0], [-1000.0, 1000.0]
        ] },
        "training": {
            "data_file": "none", "data_sha256": "0".repeat(64),
            "rows": 10, "seed": 0, "restarts": 0,
            "log_likelihood": null, "bic": null, "software": "test",
        },
        "metrics": [metrics, metrics],
    })
    .to_string()
}

#[test]
fn only_the_model_in_use_is_attached() {
    let controller = Controller::enabled();
    let (folder, file) = examination_path();
    let model = folder.path().join("staged.json");
    fs::write(&model, model_file("here")).unwrap();
    let id: ModelId = ModelFile::read(&model).unwrap().id().unwrap();
    controller.robot().model_file = Some((model.clone(), id));
    let (success, error) = record(&controller, &file, &["--duration-s", "0.2"]);
    assert!(success && !error.contains("does not contain it"), "{error}");
    let (_, info, _) = run(&["record", "info", name(&file)]);
    assert!(info.contains("attached staged.json"), "{info}");
    // A different model has been written over it.
    fs::write(&model, model_file("elsewhere")).unwrap();
    let other = folder.path().join("other.mcap");
    let (success, error) = record(&controller, &other, &["--duration-s", "0.2"]);
    assert!(success && error.contains("does not contain it"), "{error}");
    let (_, info, _) = run(&["record", "info", name(&other)]);
    assert!(!info.contains("attached staged.json"), "{info}");
}

#[test]
fn configuration_and_run_log_are_recorded_and_extracted() {
    let mut rig = Rig::with_model();
    let mut client = rig.enabled();
    let (folder, file) = examination_path();
    let domain = rig.domain();
    let mut recorder = Program::start(&domain, &["record", "--output", name(&file)]);
    wait_for_size(&file, 50_000);
    let mut commander = client.commander();
    for step in 0..100 {
        commander.servo_jp(&[0.0005 * f64::from(step), 0.0]).unwrap();
        clock::sleep(Nanos::from_millis(5));
    }
    recorder.interrupt();
    let (code, _, error) = recorder.code();
    assert_eq!((code, error.as_str()), (Some(0), ""));
    let parts = folder.path().join("parts");
    let extract = ["record", "info", name(&file), "--output", name(&parts)];
    let (success, output, error) = run(&extract);
    assert!(success && output.contains(" commands"), "{output}{error}");
    let served = rig.folder.path().join("robot.toml");
    assert_eq!(fs::read(parts.join("robot.toml")).unwrap(), fs::read(&served).unwrap());
    for file in ["audit.jsonl", "model.json", "robot.urdf"] {
        assert!(parts.join(file).exists(), "{file}: {output}");
    }
    let (success, _, error) = run(&extract);
    assert!(!success && error.contains("cannot write"), "nothing is written over: {error}");
    // What was commanded can be commanded again.
    client.state_command(StateCommand::Release).unwrap();
    let commands = parts.join("commands.csv");
    let (success, output, error) =
        Program::run(&domain, &["command", "file", name(&commands), "--on-late", "continue"]);
    assert!(success && output.contains("followed within"), "{output}{error}");
    // A copy is the same file, a changed one is not.
    let copy = folder.path().join("copy.toml");
    fs::copy(&served, &copy).unwrap();
    let other = folder.path().join("other.mcap");
    let options = ["record", "--duration-s", "0.2", "--config", name(&copy), "--output"];
    let (success, _, error) =
        Program::run(&domain, &[&options, [name(&other)].as_slice()].concat());
    assert!(success, "{error}");
    let changed = fs::read_to_string(&served).unwrap() + "\n# changed\n";
    fs::write(&copy, changed).unwrap();
    let third = folder.path().join("third.mcap");
    let (success, _, error) =
        Program::run(&domain, &[&options, [name(&third)].as_slice()].concat());
    assert!(!success && error.contains("differs from") && !third.exists(), "{error}");
}

#[test]
fn configuration_of_a_different_robot_is_refused() {
    let controller = Controller::enabled();
    let (_folder, file) = examination_path();
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/emulator.toml");
    let options = ["--duration-s", "0.2", "--config", name(&config)];
    let (success, error) = record(&controller, &file, &options);
    assert!(!success && error.contains("i2ris-emulated"), "{error}");
    assert!(!file.exists());
}

#[test]
fn foreign_file_is_reported_as_not_a_recording() {
    let (_folder, file) = examination_path();
    fs::write(&file, "t_s,q0_counts\n0,1\n").unwrap();
    let (success, _, error) = run(&["record", "info", name(&file)]);
    assert!(!success && error.contains("is not a recording"), "{error}");
}
