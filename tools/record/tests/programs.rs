//! `i2ris record` against a controller without drives: what is in the file, and what is there after
//! a bad end.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::units::Nanos;
use tempfile::TempDir;

use i2ris_testing::{Controller, Program, program};

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn name(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn place() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trial.mcap");
    (folder, file)
}

/// Waits until a file has some size.
fn wait_for_size(file: &Path, bytes: u64) {
    let end = clock::now() + Nanos::from_millis(30_000);
    while fs::metadata(file).map_or(0, |data| data.len()) < bytes {
        assert!(clock::now() < end, "{} does not grow", file.display());
        clock::sleep(Nanos::from_millis(10));
    }
}

#[test]
fn a_recording_holds_every_stream_and_becomes_tables() {
    let controller = Controller::enabled();
    let (folder, file) = place();
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/emulator.toml");
    let arguments = [
        "record",
        "--output",
        name(&file),
        "--duration-s",
        "1.5",
        "--config",
        name(&config),
        "--json",
    ];
    let (success, output, error) = Program::run(&controller.domain, &arguments);
    assert!(success, "{error}");
    let report: serde_json::Value = serde_json::from_str(&output).unwrap();
    assert_eq!(
        (report["dropped"].as_u64(), report["missed"].is_u64()),
        (Some(0), true),
        "{output}"
    );
    assert!(
        report["messages"]["measured_js"].as_u64().unwrap() > 100,
        "{output}"
    );

    let output = program::output(&["record", "info", name(&file)]);
    let info = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    for part in [
        "i2ris.header",
        "robot_id: i2ris-emulated",
        "i2ris.outcome",
        "attached emulator.toml",
        "/measured_js",
        "/i2ris/goal_js",
    ] {
        assert!(info.contains(part), "{part}\n{info}");
    }
    let tables = folder.path().join("tables");
    assert!(
        program::output(&["record", "export", name(&file), "--output", name(&tables)])
            .status
            .success()
    );
    let output = program::output(&[
        "record",
        "export",
        name(&file),
        "--output",
        name(&tables),
        "--format",
        "parquet",
    ]);
    assert!(
        output.status.success() && text(&output.stdout).contains("measured_js.parquet"),
        "{}",
        text(&output.stderr)
    );
    assert!(
        fs::read(tables.join("measured_js.parquet"))
            .unwrap()
            .starts_with(b"PAR1")
    );
    let table = fs::read_to_string(tables.join("measured_js.csv")).unwrap();
    let mut lines = table.lines();
    assert!(
        lines
            .next()
            .unwrap()
            .starts_with("t_s,received_s,sequence,stamp_ns,boot_id,position_0,position_1")
    );
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(
        rows.len() as u64,
        report["messages"]["measured_js"].as_u64().unwrap()
    );
    assert!(
        rows.iter()
            .all(|row| (row[5].parse::<f64>().unwrap().to_degrees() - 1.0).abs() < 1e-9)
    );
    assert!(
        rows.windows(2)
            .all(|pair| pair[0][2].parse::<u64>().unwrap() < pair[1][2].parse::<u64>().unwrap())
    );
}

#[test]
fn what_was_written_before_kill_9_is_recovered() {
    let controller = Controller::enabled();
    let (folder, file) = place();
    let mut program = Program::start(
        &controller.domain,
        &["record", "--output", name(&file), "--note", "killed"],
    );
    wait_for_size(&file, 100_000);
    program.child().kill().unwrap();
    program.end();
    assert!(
        !program::output(&["record", "info", name(&file)])
            .status
            .success(),
        "it is cut off, and that is said"
    );
    let whole = folder.path().join("whole.mcap");
    let output = program::output(&["record", "recover", name(&file), "--output", name(&whole)]);
    assert!(
        output.status.success() && text(&output.stdout).contains("1 metadata records"),
        "{}",
        text(&output.stdout)
    );
    let info = program::output(&["record", "info", name(&whole)]);
    assert!(
        info.status.success() && text(&info.stdout).contains("note: killed"),
        "{}",
        text(&info.stdout)
    );
}

#[test]
fn a_full_disk_ends_the_recording_with_a_reason_and_leaves_what_was_written() {
    let controller = Controller::enabled();
    let (folder, file) = place();
    let arguments = [
        "record",
        "--output",
        name(&file),
        "--duration-s",
        "30",
        "--domain",
        controller.domain.name(),
    ];
    let output = with_full_disk(&arguments, 60_000);
    let error = text(&output.stderr);
    assert!(
        !output.status.success() && error.contains("trial.mcap") && error.contains("recover"),
        "{error}"
    );
    let whole = folder.path().join("whole.mcap");
    let output = program::output(&["record", "recover", name(&file), "--output", name(&whole)]);
    assert!(
        output.status.success() && !text(&output.stdout).contains("recovered 0"),
        "{}",
        text(&output.stdout)
    );
}

#[test]
fn two_recorders_do_not_disturb_each_other_and_never_share_a_file() {
    let controller = Controller::enabled();
    let (folder, file) = place();
    let arguments = |file| ["record", "--output", file, "--duration-s", "1"];
    let first = Program::start(&controller.domain, &arguments(name(&file)));
    wait_for_size(&file, 1);
    let (success, _, error) = Program::run(&controller.domain, &arguments(name(&file)));
    assert!(!success && error.contains("does not exist yet"), "{error}");
    let other = folder.path().join("other.mcap");
    let (success, _, error) = Program::run(&controller.domain, &arguments(name(&other)));
    assert!(success, "{error}");
    assert!(first.end().0);
    assert!([&file, &other].iter().all(|file| {
        program::output(&["record", "info", name(file)])
            .status
            .success()
    }));
}

/// Runs the command line with a limit on the size of files: a write is refused as by a full disk.
fn with_full_disk(arguments: &[&str], bytes: u64) -> Output {
    let mut command = program::command(arguments);
    command.stdin(Stdio::null());
    // SAFETY: both calls are async-signal-safe and touch no memory of the parent.
    unsafe {
        command.pre_exec(move || {
            use nix::sys::signal::{SigHandler, Signal, signal};
            signal(Signal::SIGXFSZ, SigHandler::SigIgn)?;
            let limit = nix::libc::rlimit {
                rlim_cur: bytes,
                rlim_max: bytes,
            };
            nix::errno::Errno::result(nix::libc::setrlimit(nix::libc::RLIMIT_FSIZE, &limit))?;
            Ok(())
        });
    }
    command.output().unwrap()
}

#[test]
fn a_report_is_made_of_a_trial_whole_or_cut_off() {
    let controller = Controller::enabled();
    let (folder, file) = place();
    let arguments = [
        "record",
        "--output",
        name(&file),
        "--duration-s",
        "1",
        "--note",
        "a <short> one",
    ];
    let (success, _, error) = Program::run(&controller.domain, &arguments);
    assert!(success, "{error}");
    let output = program::output(&["report", name(&file)]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let page = fs::read_to_string(folder.path().join("trial.html")).unwrap();
    assert!(
        page.contains("a &lt;short&gt; one") && page.contains("<svg") && !page.contains("<script"),
        "{page}"
    );
    let output = program::output(&["report", name(&file), "--json"]);
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(
        summary["estimate"]["samples"].as_u64().unwrap() > 50,
        "{summary}"
    );
    assert!(
        summary["estimate"]["length_rms_deg"].as_f64().unwrap() < 1e-9,
        "it follows at once"
    );
    assert!(
        summary["events"][0]["what"]
            .as_str()
            .unwrap()
            .contains("ENABLED"),
        "{summary}"
    );

    let cut = folder.path().join("cut.mcap");
    let bytes = fs::read(&file).unwrap();
    fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let output = program::output(&["report", name(&cut)]);
    assert!(
        output.status.success() && text(&output.stderr).contains("not whole"),
        "{}",
        text(&output.stderr)
    );
    fs::write(&cut, "no recording at all, whatever its name says").unwrap();
    let output = program::output(&["report", name(&cut)]);
    assert!(
        !output.status.success() && text(&output.stderr).contains("cut.mcap"),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn pages_and_tables_on_a_full_disk_end_with_a_reason() {
    let controller = Controller::enabled();
    let (folder, file) = place();
    let (success, _, error) = Program::run(
        &controller.domain,
        &["record", "--output", name(&file), "--duration-s", "1"],
    );
    assert!(success, "{error}");
    let tables = folder.path().join("tables");
    for format in ["csv", "parquet"] {
        let arguments = [
            "record",
            "export",
            name(&file),
            "--output",
            name(&tables),
            "--format",
            format,
        ];
        let output = with_full_disk(&arguments, 5000);
        let error = text(&output.stderr);
        assert!(
            !output.status.success() && error.contains("cannot write") && error.contains(format),
            "{error}"
        );
    }
    let output = with_full_disk(&["report", name(&file)], 5000);
    assert!(
        !output.status.success() && text(&output.stderr).contains("trial.html"),
        "{}",
        text(&output.stderr)
    );
    assert!(
        !folder.path().join("trial.html").exists(),
        "half a page is none"
    );
}

/// What the controller wrote down of a run goes into the recording of it, and nothing of other
/// runs.
#[test]
fn the_log_of_the_run_goes_into_the_recording() {
    let controller = Controller::enabled();
    let (folder, file) = place();
    let config = folder.path().join("robot.toml");
    let emulator = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/emulator.toml");
    let text_of = fs::read_to_string(emulator)
        .unwrap()
        .replace("../target/records", "records");
    fs::write(&config, text_of).unwrap();
    let mut client = Client::connect(&controller.domain, Nanos::from_millis(5000)).unwrap();
    let run = format!("{:016x}", client.version().unwrap().boot_id);
    fs::create_dir(folder.path().join("records")).unwrap();
    let log = format!(
        "{{\"run\":\"{run}\",\"event\":\"begin\",\"software\":\"x\"}}\n{{\"run\":\"0123\",\"event\":\"begin\"}}\n"
    );
    fs::write(folder.path().join("records/runs.jsonl"), log).unwrap();
    let arguments = [
        "record",
        "--output",
        name(&file),
        "--duration-s",
        "0.5",
        "--config",
        name(&config),
    ];
    let (success, _, error) = Program::run(&controller.domain, &arguments);
    assert!(success, "{error}");
    let info = text(&program::output(&["record", "info", name(&file)]).stdout);
    assert!(
        info.contains("attached audit-begin.jsonl") && info.contains("attached audit.jsonl"),
        "{info}"
    );
    let bytes = fs::read(&file).unwrap();
    let found = |word: &str| {
        bytes
            .windows(word.len())
            .any(|window| window == word.as_bytes())
    };
    assert!(found("\"software\":\"x\"") && !found("\"run\":\"0123\""));
}

#[test]
fn places_that_cannot_be_written_are_refused_before_anything_else() {
    let controller = Controller::enabled();
    let missing = Path::new("/nonexistent/folder/trial.mcap");
    let (success, _, error) =
        Program::run(&controller.domain, &["record", "--output", name(missing)]);
    assert!(
        !success && error.contains("cannot make /nonexistent/folder/trial.mcap"),
        "{error}"
    );
    // Read-only for everyone, root included.
    let (success, _, error) = Program::run(
        &controller.domain,
        &["record", "--output", "/proc/trial.mcap"],
    );
    assert!(
        !success && error.contains("cannot make /proc/trial.mcap"),
        "{error}"
    );
}
