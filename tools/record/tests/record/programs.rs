//! `i2ris record` and `i2ris record report` against a controller without drives.

use std::fs;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::VirtualFixturesMsg;
use i2ris::model::ModelId;
use i2ris::model::file::{ModelFile, OutputUnit};
use i2ris::process::robot_description;
use i2ris::units::Nanos;
use i2ris_testing::bench::{WorkFolder, assert_says, ends, fails, repository, start, succeeds};
use i2ris_testing::{Controller, Rig, TIMEOUT, program, wait_until};
use serde_json::Value;

const EMULATOR: &str = "config/emulator.toml";

fn wait_for_size(bench: &WorkFolder, bytes: u64) {
    let size = || fs::metadata(bench.path("trial.mcap")).map_or(0, |data| data.len());
    wait_until("the file grows", || size() >= bytes);
}

/// Words that record into the file `trial.mcap`.
fn words(bench: &WorkFolder, options: &str) -> String {
    bench.words(&format!("record --output @trial.mcap {options}"))
}

fn record(controller: &Controller, bench: &WorkFolder, options: &str) {
    succeeds(&controller.domain, &words(bench, options));
}

/// The controller publishes robot and limits of this configuration.
pub fn runs_with(controller: &Controller, config: &Path) {
    controller.robot().description = robot_description(&Config::load(config).unwrap());
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn a_recording_has_every_stream_and_is_exported() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    controller.robot().fixtures = Some(VirtualFixturesMsg {
        active: 3,
        limited_by: 2,
        values: [[0.125; 17]; 8],
        ..VirtualFixturesMsg::default()
    });
    let config = repository(EMULATOR);
    runs_with(&controller, &config);
    let options = format!("--duration-s 1.5 --config {} --json", config.display());
    let report = json(&succeeds(&controller.domain, &words(&bench, &options)));
    assert_eq!(report["dropped"].as_u64(), Some(0), "{report}");
    assert!(report["missed"].is_u64(), "{report}");
    let messages = report["messages"]["measured_js"].as_u64().unwrap();
    assert!(messages > 100, "{report}");

    let parts = ["i2ris.header", "robot_id: i2ris-emulated", "i2ris.outcome", "recorded 20"];
    let topics = ["attached emulator.toml", "/measured_js", "/i2ris/goal_js"];
    assert_says(&bench.succeeds("record info trial.mcap"), &[&parts[..], &topics].concat());
    let info = json(&bench.succeeds("record info trial.mcap --json"));
    assert_eq!(info["metadata"]["i2ris.header"]["robot_id"], "i2ris-emulated");
    assert_eq!(info["topics"]["/i2ris/measured_js"]["messages"], messages);
    let read = program::example("read_recording", &[&bench.file("trial.mcap")]);
    assert!(read.starts_with(&format!("{messages} samples\npitch: ")), "{read}");
    assert!(info["recorded"][0].as_str().unwrap().ends_with('Z'), "{info}");
    bench.succeeds("record export trial.mcap --output tables");
    let table = bench.read("tables/measured_js.csv");
    assert_says(&bench.read("tables/units.csv"), &["measured_js,yaw_velocity_deg_s,deg/s"]);
    let header = "time,t_s,received_s,sequence,stamp_ns,boot_id,pitch_deg,yaw_deg";
    assert!(table.starts_with(header), "{table}");
    let rows = table.lines().skip(1).map(|line| line.split(',').collect());
    let rows: Vec<Vec<&str>> = rows.collect();
    assert_eq!(rows.len() as u64, messages);
    let degrees = |row: &Vec<&str>| row[6].parse::<f64>().unwrap();
    assert!(rows.iter().all(|row| (degrees(row) - 1.0).abs() < 1e-9));
    let sequence = |row: &Vec<&str>| row[3].parse::<u64>().unwrap();
    assert!(rows.windows(2).all(|pair| sequence(&pair[0]) < sequence(&pair[1])));
    let table = bench.read("tables/virtual_fixtures.csv");
    let mut rows = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let (names, row) = (rows.next().unwrap(), rows.next().unwrap());
    let place = |name: &str| names.iter().position(|it| *it == name).unwrap();
    for (name, wanted) in [("active", "3"), ("limited_by", "2"), ("values_135", "0.125")] {
        assert_eq!(row[place(name)], wanted, "{name}");
    }
}

#[test]
fn what_was_written_before_kill_9_is_recovered() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    let mut program = start(&controller.domain, &words(&bench, "--note killed"));
    wait_for_size(&bench, 100_000);
    program.child().kill().unwrap();
    program.end();
    assert_ne!(bench.run("record info trial.mcap").code, Some(0), "truncated: an error");
    let recovered = bench.succeeds("record recover trial.mcap --output whole.mcap");
    assert_says(&recovered, &["1 metadata records"]);
    assert_says(&bench.succeeds("record info whole.mcap"), &["note: killed"]);
}

#[test]
fn full_disk_ends_the_recording_and_keeps_written_data() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    let options = format!("--duration-s 30 --domain {}", controller.domain.name());
    let error = full_disk(&words(&bench, &options), 60_000);
    // The limit on the size of a file, which replaces the full disk here.
    assert_says(&error, &["trial.mcap", "recover", "File too large"]);
    let recovered = bench.succeeds("record recover trial.mcap --output whole.mcap");
    assert!(!recovered.contains("recovered 0"), "{recovered}");
}

#[test]
fn two_recorders_are_independent_and_never_share_a_file() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    let first = start(&controller.domain, &words(&bench, "--duration-s 1"));
    wait_for_size(&bench, 1);
    let again = start(&controller.domain, &words(&bench, "--duration-s 1"));
    ends(again, 1, &["does not exist yet"]);
    let other = bench.words("record --output @other.mcap --duration-s 1");
    succeeds(&controller.domain, &other);
    ends(first, 0, &[]);
    for file in ["trial.mcap", "other.mcap"] {
        bench.succeeds(&format!("record info {file}"));
    }
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

/// Expects a failure where files are limited, and returns its message.
fn full_disk(words: &str, bytes: u64) -> String {
    let mut command = program::command(&words.split(' ').collect::<Vec<_>>());
    limit_files(&mut command, bytes);
    let output = command.stdin(std::process::Stdio::null()).output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success(), "{error}");
    error
}

#[test]
fn report_accepts_complete_and_truncated_recordings() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    record(&controller, &bench, "--duration-s 1 --note a<short>one");
    bench.succeeds("record report trial.mcap");
    let page = bench.read("trial.html");
    assert_says(&page, &["a&lt;short&gt;one", "<svg"]);
    assert!(!page.contains("<script"), "{page}");
    let summary = json(&bench.succeeds("record report trial.mcap --json"));
    assert!(summary["estimate"]["samples"].as_u64().unwrap() > 50, "{summary}");
    let rms = summary["estimate"]["length_rms_deg"].as_f64().unwrap();
    assert!(rms < 1e-9, "this robot follows at once: {rms}");
    assert!(summary["events"][0]["what"].as_str().unwrap().contains("ENABLED"), "{summary}");

    let bytes = fs::read(bench.path("trial.mcap")).unwrap();
    fs::write(bench.path("cut.mcap"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    let cut = bench.run("record report cut.mcap");
    assert_ne!(cut.code, Some(0));
    assert_says(&format!("{}{}", cut.output, cut.error), &["not complete", "written"]);
    bench.write("cut.mcap", "no recording at all, whatever its name says");
    bench.fails("record report cut.mcap", &["cut.mcap"]);
    bench.fails("record info cut.mcap", &["is not a recording"]);
}

#[test]
fn reports_and_tables_fail_with_a_reason_on_full_disk() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    record(&controller, &bench, "--duration-s 1");
    let error = full_disk(&bench.words("record export @trial.mcap --output @tables"), 5000);
    assert_says(&error, &["cannot write", "csv"]);
    let error = full_disk(&bench.words("record report @trial.mcap"), 5000);
    assert_says(&error, &["trial.html"]);
    assert!(!bench.exists("trial.html"), "there must be no incomplete page");
}

#[test]
fn recording_contains_the_run_log_of_this_run() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    let config = fs::read_to_string(repository(EMULATOR)).unwrap();
    bench.write("robot.toml", &config.replace("../target/records", "records"));
    let mut client = Client::connect(&controller.domain, TIMEOUT).unwrap();
    let run_id = format!("{:016x}", client.version().unwrap().boot_id);
    fs::create_dir(bench.path("records")).unwrap();
    let log = format!(
        "{{\"run\":\"{run_id}\",\"event\":\"begin\",\"software\":\"x\"}}\n\
         {{\"run\":\"0123\",\"event\":\"begin\"}}\n"
    );
    bench.write("records/runs.jsonl", &log);
    runs_with(&controller, &bench.path("robot.toml"));
    record(&controller, &bench, &bench.words("--duration-s 0.5 --config @robot.toml"));
    let attached = ["attached audit-begin.jsonl", "attached audit.jsonl"];
    assert_says(&bench.succeeds("record info trial.mcap"), &attached);
    let bytes = fs::read(bench.path("trial.mcap")).unwrap();
    let contains = |word: &str| bytes.windows(word.len()).any(|window| window == word.as_bytes());
    assert!(contains("\"software\":\"x\"") && !contains("\"run\":\"0123\""));
}

#[test]
fn files_that_cannot_be_created_are_refused_first() {
    let controller = Controller::enabled();
    // /proc is read-only for everyone, root included.
    for path in ["/nonexistent/folder/trial.mcap", "/proc/trial.mcap"] {
        let words = format!("record --output {path}");
        fails(&controller.domain, &words, 1, &[&format!("cannot create {path}")]);
    }
}

fn model_file(robot_id: &str) -> String {
    let file = i2ris_testing::cycle::model(OutputUnit::Deg).file().clone();
    let file = ModelFile { robot_id: robot_id.to_owned(), ..file };
    serde_json::to_string(&file).unwrap()
}

#[test]
fn only_the_model_in_use_is_attached() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    let model = bench.path("staged.json");
    bench.write("staged.json", &model_file("here"));
    let id: ModelId = ModelFile::read(&model).unwrap().id().unwrap();
    controller.robot().model_file = Some((model, id));
    let attached = |file: &str| {
        let words = bench.words(&format!("record --output @{file} --duration-s 0.2"));
        let error = ends(start(&controller.domain, &words), 0, &[]).error;
        let info = bench.succeeds(&format!("record info {file}"));
        (info.contains("attached staged.json"), error.contains("does not contain it"))
    };
    assert_eq!(attached("trial.mcap"), (true, false));
    // A different model has been written over it.
    bench.write("staged.json", &model_file("elsewhere"));
    assert_eq!(attached("other.mcap"), (false, true));
}

#[test]
fn configuration_and_run_log_are_recorded_and_extracted() {
    let mut rig = Rig::with_model();
    let mut client = rig.enabled();
    let (bench, domain) = (WorkFolder::empty(), rig.domain());
    let mut recorder = start(&domain, &words(&bench, ""));
    wait_for_size(&bench, 50_000);
    let mut commander = client.commander();
    for step in 0..100 {
        commander.servo_jp(&[0.0005 * f64::from(step), 0.0]).unwrap();
        clock::sleep(Nanos::from_millis(5));
    }
    recorder.interrupt();
    assert_eq!(ends(recorder, 0, &[]).error, "");
    let extract = "record info trial.mcap --output parts";
    assert_says(&bench.succeeds(extract), &[" commands"]);
    let served = rig.folder.path().join("robot.toml");
    assert_eq!(bench.read("parts/robot.toml"), fs::read_to_string(&served).unwrap());
    for file in ["audit.jsonl", "model.json", "robot.urdf"] {
        assert!(bench.exists(&format!("parts/{file}")), "{file}");
    }
    // Nothing is written over.
    bench.fails(extract, &["cannot write"]);
    // What was commanded can be commanded again.
    client.state_command(StateCommand::Release).unwrap();
    let again = bench.words("command file @parts/commands.csv --on-late continue");
    assert_says(&succeeds(&domain, &again), &["followed within"]);
    // A copy is the same file, a changed one is not.
    fs::copy(&served, bench.path("copy.toml")).unwrap();
    let with_copy = |file: &str| {
        bench.words(&format!("record --duration-s 0.2 --config @copy.toml --output @{file}"))
    };
    succeeds(&domain, &with_copy("other.mcap"));
    bench.write("copy.toml", &(fs::read_to_string(&served).unwrap() + "\n# changed\n"));
    fails(&domain, &with_copy("third.mcap"), 1, &["differs from"]);
    assert!(!bench.exists("third.mcap"));
}

#[test]
fn configuration_of_a_different_robot_is_refused() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    let options = format!("--duration-s 0.2 --config {}", repository(EMULATOR).display());
    fails(&controller.domain, &words(&bench, &options), 1, &["i2ris-emulated"]);
    assert!(!bench.exists("trial.mcap"));
}
