//! `i2ris bench` as a process.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use i2ris_testing::program;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs a benchmark as JSON, with normal scheduling, because other tests run at the same time.
fn bench(arguments: &[&str]) -> serde_json::Value {
    let words = [&["bench"], arguments, &["--json", "--priority", "0"]].concat();
    let mut output = program::output(&words);
    // Linux 6.13 to 6.18.44 may deliver nothing on any pseudo-terminal for seconds.
    if ["homing failed", "busy", "no reply"].iter().any(|it| text(&output.stderr).contains(it)) {
        output = program::output(&words);
    }
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Checks that every variant was measured and is compared with a floor.
fn check_outcome(outcome: &serde_json::Value, groups_with_floor: &[&str]) {
    let variants = outcome["variants"].as_array().unwrap();
    for variant in variants {
        let durations = &variant["spans_ns"];
        assert!(durations["count"].as_u64().unwrap() > 0, "{variant}");
        let rising = ["p50", "p99", "max"].map(|it| durations[it].as_u64());
        assert!(rising.is_sorted(), "{variant}");
        let compared = variant["role"] != "floor"
            && groups_with_floor.iter().any(|group| variant["group"] == *group);
        assert_eq!(variant["x_floor"]["p50"].is_f64(), compared, "{variant}");
    }
    assert!(outcome["machine"]["kernel"].as_str().is_some_and(|kernel| !kernel.is_empty()));
    assert!(outcome["notes"].as_array().is_some_and(|notes| !notes.is_empty()));
}

#[test]
fn every_variant_is_measured_and_compared_with_its_floor() {
    let outcome = bench(&["loop", "--duration-s", "1"]);
    check_outcome(&outcome, &["lateness", "compute"]);
    check_outcome(&bench(&["inverse", "--turns", "1"]), &["inverse", "forward"]);
}

/// The controller is a program of another package: it exists after a build of the workspace.
#[test]
fn a_command_is_measured_to_the_wire_and_back() {
    let controller = Path::new(env!("CARGO_BIN_EXE_i2ris-bench")).with_file_name("i2ris-control");
    assert!(controller.exists(), "build the programs of the workspace");
    let outcome = bench(&["e2e", "--commands", "80", "--busy", "1"]);
    let arrived = "command to last byte of the setpoint";
    let seen = "command to encoder position at the client";
    check_outcome(&outcome, &[arrived, seen]);
    let p50 = |group: &str| {
        let variants = outcome["variants"].as_array().unwrap();
        let is_ours = |it: &&serde_json::Value| it["group"] == group && it["role"] == "ours";
        variants.iter().find(is_ours).unwrap()["spans_ns"]["p50"].as_u64().unwrap()
    };
    assert!(p50("command to the tick that reads it") < p50("command to operating system"));
    // Causes come before effects, whatever the machine does.
    let [written, arrived, seen] = ["command to operating system", arrived, seen].map(p50);
    assert!(written < arrived && arrived < seen, "{outcome}");
}

/// See above; `i2ris` is a program of another package.
#[test]
fn an_event_is_measured_to_the_wire() {
    let controller = Path::new(env!("CARGO_BIN_EXE_i2ris-bench")).with_file_name("i2ris-control");
    assert!(controller.with_file_name("i2ris").exists(), "build the programs of the workspace");
    let outcome = bench(&["hand", "--events", "60"]);
    let arrived = "event to last byte of the setpoint";
    check_outcome(&outcome, &[arrived]);
    let variants = outcome["variants"].as_array().unwrap();
    let of = |group: &str| variants.iter().rfind(|variant| variant["group"] == group).unwrap();
    let p50 = |group: &str| of(group)["spans_ns"]["p50"].as_u64().unwrap();
    // Causes come before effects, whatever the machine does.
    assert!(p50("event to command") < p50(arrived), "{outcome}");
    assert!(of(arrived)["spans_ns"]["count"].as_u64().unwrap() > 30, "{outcome}");
}

#[test]
fn several_rates_of_the_loop_have_a_floor_each() {
    let outcome = bench(&["loop", "--rate-hz", "1000,4000", "--duration-s", "1"]);
    let groups = ["lateness, 1000 Hz", "lateness, 4000 Hz", "compute, 1000 Hz"];
    check_outcome(&outcome, &[&groups[..], &["compute, 4000 Hz"]].concat());
    assert_eq!(outcome["variants"].as_array().unwrap().len(), 18);
}
