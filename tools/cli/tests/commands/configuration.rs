//! What needs no controller: configurations, completions, units of systemd.
#![allow(clippy::print_stderr, reason = "a test that skips says so")]

use std::fs;
use std::path::Path;
use std::process::Command;

use i2ris_testing::program;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_configuration_is_judged_and_printed_with_its_defaults() {
    let good = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/emulator.toml");
    let output = program::output(&["config", "check", good.to_str().unwrap()]);
    assert!(
        output.status.success()
            && text(&output.stdout).contains("valid; robot i2ris-emulated, 2 motor(s)")
    );
    let folder = tempfile::tempdir().unwrap();
    let printed = folder.path().join("printed.toml");
    fs::write(&printed, program::output(&["config", "print", good.to_str().unwrap()]).stdout)
        .unwrap();
    assert!(
        program::output(&["config", "check", printed.to_str().unwrap()]).status.success(),
        "what is printed is valid, too"
    );
    let bad = folder.path().join("bad.toml");
    fs::write(&bad, fs::read_to_string(&good).unwrap().replace("rate_hz", "rate_herz")).unwrap();
    let output = program::output(&["config", "check", bad.to_str().unwrap()]);
    let error = text(&output.stderr);
    assert!(
        !output.status.success() && error.contains("bad.toml") && error.contains("rate_herz"),
        "{error}"
    );
}

#[test]
fn shells_are_told_every_subcommand() {
    for shell in ["bash", "zsh", "fish"] {
        let output = program::output(&["completions", shell]);
        let script = text(&output.stdout);
        assert!(output.status.success());
        for word in ["calibrate", "vision", "record", "monitor"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
}

/// The units, with the programs of this build in the place of the installed ones.
#[test]
fn the_units_of_systemd_are_valid() {
    let probe = Command::new("systemd-analyze").arg("--version").output();
    if !probe.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: there is no systemd-analyze");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/system");
    let units = ["i2ris-control@.service", "i2ris-watchdog@.service"].map(|name| {
        let text = fs::read_to_string(from.join(name)).unwrap();
        assert!(text.contains("ExecStart=/usr/local/bin/i2ris-"), "{name}");
        let program = text.lines().find_map(|line| line.strip_prefix("ExecStart=")).unwrap();
        let installed = program.split(' ').next().unwrap();
        let unit = folder.path().join(name);
        fs::write(&unit, text.replace(installed, env!("CARGO_BIN_EXE_i2ris"))).unwrap();
        unit
    });
    let output = Command::new("systemd-analyze").arg("verify").args(&units).output().unwrap();
    let said = text(&output.stdout) + &text(&output.stderr);
    let ours: Vec<&str> = said.lines().filter(|line| line.contains("i2ris")).collect();
    assert!(ours.is_empty(), "{ours:?}");
}
