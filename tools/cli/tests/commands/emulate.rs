//! `i2ris emulate` as a process: starts, serves, ends cleanly, and says in one sentence what is
//! wrong.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use i2ris::ipc::{Domain, DomainLock, random_id};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

fn snake(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../config/snakes/{name}.toml"))
}

fn emulate(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_i2ris"));
    command.arg("emulate").args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// A child that does not outlive its test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn signals_end_it_cleanly() {
    for signal in [Signal::SIGINT, Signal::SIGTERM] {
        let folder = tempfile::tempdir().unwrap();
        let (ports, log) = (folder.path().join("ports"), folder.path().join("log.csv"));
        let mut command = emulate(&["--no-camera", "--snake"]);
        command.arg(snake("multi")).arg("--ports").arg(&ports).arg("--log").arg(&log);
        let mut running = Running(command.spawn().unwrap());
        let mut output = BufReader::new(running.0.stdout.take().unwrap());
        let mut lines = String::new();
        while !lines.contains("ready") {
            assert!(output.read_line(&mut lines).unwrap() > 0, "{lines}");
        }
        assert!(ports.join("axis0").exists() && ports.join("axis1").exists());
        assert!(lines.contains(ports.join("axis1").to_str().unwrap()), "{lines}");
        kill(Pid::from_raw(running.0.id().try_into().unwrap()), signal).unwrap();
        output.read_to_string(&mut lines).unwrap();
        assert_eq!(running.0.wait().unwrap().code(), Some(0), "{lines}");
        assert!(!ports.exists());
        assert!(std::fs::read_to_string(log).unwrap().contains(",boot,"));
    }
}

#[test]
fn it_ends_by_itself_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = emulate(&["--duration", "0.2", "--domain", "t-emulate-duration", "--snake"]);
    let output = command
        .arg(snake("brass"))
        .arg("--ports")
        .arg(folder.path().join("ports"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(
        String::from_utf8_lossy(&output.stdout).contains("ended: 0 and 0 requests"),
        "{output:?}"
    );
}

/// Ends with a code other than 0 and one sentence on stderr that holds `words`.
fn assert_refused(output: &Output, words: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{message}");
    assert!(message.contains("error: ") && !message.contains("panicked"), "{message}");
    assert!(words.iter().all(|word| message.contains(word)), "{message}");
}

#[test]
fn bad_input_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let steel = snake("steel").to_string_lossy().into_owned();
    let bad = folder.path().join("bad.toml");
    std::fs::write(&bad, std::fs::read_to_string(&steel).unwrap().replace("drag_s", "drag"))
        .unwrap();
    let in_the_way = folder.path().join("file");
    std::fs::write(&in_the_way, "").unwrap();
    let (bad, in_the_way) = (bad.to_string_lossy(), in_the_way.to_string_lossy());
    let ports = folder.path().join("ports").to_string_lossy().into_owned();
    for (arguments, words) in [
        (vec!["--snake", "none.toml"], vec!["none.toml", "name an existing file"]),
        (vec!["--snake", &bad], vec!["bad.toml", "drag"]),
        (vec!["--snake", "adder:1"], vec!["`adder:1` names no snake", "brass", "preisach:SEED"]),
        (vec!["--snake", "dahl:x"], vec!["`x` is no seed", "a whole number"]),
        (vec!["--snake", &steel, "--ports", &in_the_way], vec!["file", "--ports"]),
        (
            vec!["--snake", &steel, "--ports", &ports, "--log", "/proc/none/log"],
            vec!["/proc/none/log"],
        ),
        (vec!["--snake", &steel, "--ports", &ports, "--domain", "a/b"], vec!["a/b"]),
        (vec!["--snake", &steel, "--duration", "nan"], vec!["--duration", "seconds"]),
    ] {
        let output = emulate(&arguments).output().unwrap();
        assert_refused(&output, &words);
        assert!(!Path::new(&ports).exists(), "{arguments:?} left something behind");
    }
}

/// The configuration of a controller for emulated drives in a folder.
fn controller_config(ports: &Path, change: impl Fn(String) -> String) -> PathBuf {
    let standard = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/emulator.toml");
    let text = std::fs::read_to_string(standard).unwrap();
    let file = ports.with_extension("toml");
    std::fs::write(&file, change(text.replace("/tmp/i2ris-emulator", &ports.to_string_lossy())))
        .unwrap();
    file
}

fn doctor(config: &Path, more: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_i2ris"))
        .arg("doctor")
        .arg("--config")
        .arg(config)
        .args(more)
        .output()
        .unwrap()
}

#[test]
fn the_doctor_looks_at_drives_and_machine() {
    let folder = tempfile::tempdir().unwrap();
    let ports = folder.path().join("ports");
    let mut command = emulate(&["--no-camera", "--family", "epos2", "--framing", "v1", "--snake"]);
    let mut running =
        Running(command.arg(snake("steel")).arg("--ports").arg(&ports).spawn().unwrap());
    let mut output = BufReader::new(running.0.stdout.take().unwrap());
    let mut lines = String::new();
    while !lines.contains("ready") {
        assert!(output.read_line(&mut lines).unwrap() > 0, "{lines}");
    }
    let epos2 = |text: String| {
        text.replace("baud = 115200", "baud = 115200\nfamily = \"epos2\"\nframing = \"v1\"")
    };
    let config = controller_config(&ports, epos2);
    let healthy = doctor(&config, &[]);
    let said = String::from_utf8_lossy(&healthy.stdout);
    assert!(healthy.status.success(), "{said}");
    for part in [
        "kernel",
        "scheduling",
        "shared memory",
        "ms an exchange",
        "EPOS2, serial number 62000001",
        "not homed",
    ] {
        assert!(said.contains(part), "no `{part}` in:\n{said}");
    }
    let swapped = controller_config(&ports, |text| epos2(text).replace("62000001", "62000007"));
    let sick = doctor(&swapped, &["--json"]);
    assert!(!sick.status.success());
    let checks: serde_json::Value = serde_json::from_slice(&sick.stdout).unwrap();
    let failed: Vec<&serde_json::Value> = checks["checks"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|check| check["level"] == "fail")
        .collect();
    assert_eq!(failed.len(), 1, "{failed:?}");
    assert!(
        failed[0]["found"].as_str().unwrap().contains("62000001 (0x03B20B81) instead of 62000007"),
        "{failed:?}"
    );
    assert!(!failed[0]["fix"].as_str().unwrap().is_empty());
}

#[test]
fn the_doctor_names_a_port_that_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let output = doctor(&controller_config(&folder.path().join("ports"), |text| text), &[]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(!output.status.success());
    assert!(
        said.contains("FAIL") && said.contains("axis0") && said.contains("-> plug in the drive"),
        "{said}"
    );
}

#[test]
fn snakes_by_name_are_there_in_every_folder() {
    for name in ["brass", "springs:2", "lugre:3", "wire"] {
        let folder = tempfile::tempdir().unwrap();
        let mut command = emulate(&["--no-camera", "--duration", "0.2", "--snake", name]);
        command.current_dir(folder.path()).args(["--ports", "ports"]);
        let output = command.output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        let shown = text.contains(&format!("ready: snake {name}"));
        assert!(output.status.success() && shown, "{name}: {output:?}");
    }
}

#[test]
fn help_names_every_physics() {
    let output = emulate(&["--help"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    for physics in i2ris_emulator::zoo::Physics::NAMES {
        assert!(text.contains(&format!("- {physics}: ")), "{physics} in {text}");
    }
}

#[test]
fn it_finds_its_snake_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = emulate(&["--duration", "0.2", "--no-camera", "--ports"]);
    let output =
        command.arg(folder.path().join("ports")).current_dir(folder.path()).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}

#[test]
fn start_runs_emulator_and_controller_and_ends_both() {
    let folder = tempfile::tempdir().unwrap();
    let domain = Domain::new(&format!("t{:016x}", random_id())).unwrap();
    let place = folder.path().join("here");
    let mut command = i2ris_testing::program::command(&["start", "--no-monitor", "--folder"]);
    command
        .arg(&place)
        .args(["--domain", domain.name()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut running = Running(command.spawn().unwrap());
    let mut lines = BufReader::new(running.0.stdout.take().unwrap());
    let mut first = String::new();
    lines.read_line(&mut first).unwrap();
    let logs = |name: &str| std::fs::read_to_string(place.join(name)).unwrap_or_default();
    assert!(
        first.contains("ready") && first.contains(domain.name()),
        "{first}{}{}",
        logs("emulator.log"),
        logs("controller.log")
    );
    kill(Pid::from_raw(running.0.id().try_into().unwrap()), Signal::SIGINT).unwrap();
    let status = running.0.wait().unwrap();
    let mut error = String::new();
    let _ = running.0.stderr.take().unwrap().read_to_string(&mut error);
    assert_eq!(status.code(), Some(0), "{error}");
    assert!(!place.join("ports").exists(), "the emulator has ended");
    assert!(logs("emulator.log").contains("ended"), "{}", logs("emulator.log"));
    assert!(logs("controller.log").contains(&format!("serves domain `{}`", domain.name())));
    // The lock is free: the controller has ended.
    drop(DomainLock::acquire(&domain).unwrap());
}
