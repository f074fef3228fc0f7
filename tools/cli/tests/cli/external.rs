//! `i2ris NAME` runs the program `i2ris-NAME`.

use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

use i2ris_testing::{program, wait_until};

use crate::bench::{WorkFolder, assert_says};

/// `i2ris` in a separate folder, without its programs.
struct Installed(WorkFolder);

impl Installed {
    fn new() -> Self {
        let bench = WorkFolder::new();
        fs::copy(program::path("i2ris"), bench.path("i2ris")).unwrap();
        Self(bench)
    }

    fn add(&self, name: &str, script: &str) {
        self.0.write(name, &format!("#!/bin/sh\n{script}\n"));
        fs::set_permissions(self.0.path(name), fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn run(&self, path: &Path, arguments: &[&str]) -> Output {
        let mut command = Command::new(self.0.path("i2ris"));
        command.args(arguments).env("PATH", path);
        // A process that another test has just started may still have the copy open for writing.
        wait_until("the copy can be started", || match command.output() {
            Err(error) if error.kind() == ErrorKind::ExecutableFileBusy => None,
            output => Some(output.unwrap()),
        })
    }
}

#[test]
fn a_program_gets_its_arguments_and_gives_its_exit_code() {
    let (neighbour, on_path) = (Installed::new(), Installed::new());
    on_path.add("i2ris-record", "echo path: \"$@\"; exit 5");
    let check = |arguments: &[&str], code, text| {
        let output = neighbour.run(&on_path.0.path(""), arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        assert_eq!(String::from_utf8_lossy(&output.stdout), text);
    };
    check(&["record", "--output", "x y"], 5, "path: --output x y\n");
    neighbour.add("i2ris-record", "echo neighbour: \"$@\"");
    check(&["record", "info"], 0, "neighbour: info\n");
    check(&["help", "record"], 0, "neighbour: --help\n");
}

#[test]
fn missing_program_is_reported_with_the_build_command() {
    let installed = Installed::new();
    let output = installed.run(Path::new("/nonexistent"), &["record", "report", "trial.mcap"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    assert!(error.contains("cargo build --release -p i2ris-record"), "{error}");
    let help = installed.run(Path::new("/nonexistent"), &["--help"]).stdout;
    let help = String::from_utf8_lossy(&help);
    for name in ["status", "record", "vision", "bench"] {
        assert_says(&help, &[&format!("\n  {name} ")]);
    }
}

#[test]
fn completions_know_the_options_of_installed_programs() {
    let installed = Installed::new();
    let description = r#"{"name": "i2ris-vision", "about": null, "subcommands": [], "arguments": [
        {"id": "all", "short": null, "long": "all-of-it", "help": "Every", "takes_values": false,
         "is_repeated": false, "is_global": false, "values": []}]}"#;
    installed.add("i2ris-vision", &format!("echo '{description}'"));
    let output = installed.run(Path::new("/nonexistent"), &["--completions", "bash"]);
    let script = String::from_utf8_lossy(&output.stdout);
    assert_says(&script, &["--all-of-it", "calibrate", "record"]);
}
