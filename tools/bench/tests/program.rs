//! `i2ris bench` as a process.
#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stderr, reason = "a test that skips says so")]

use std::fs;
use std::path::Path;

use i2ris_testing::program;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs a benchmark as JSON, without wishes that other tests would feel.
fn bench(arguments: &[&str]) -> serde_json::Value {
    let output = program::output(
        &[
            &["bench"],
            arguments,
            &["--json", "--priority", "0", "--unpinned"],
        ]
        .concat(),
    );
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Every way was measured and is in order; those of ours stand beside a floor.
fn judge(outcome: &serde_json::Value, groups_with_floor: &[&str]) {
    let ways = outcome["ways"].as_array().unwrap();
    for way in ways {
        let spans = &way["spans_ns"];
        assert!(spans["count"].as_u64().unwrap() > 0, "{way}");
        assert!(
            spans["p50"].as_u64() <= spans["p99"].as_u64()
                && spans["p99"].as_u64() <= spans["max"].as_u64(),
            "{way}"
        );
        let compared =
            way["role"] != "floor" && groups_with_floor.iter().any(|group| way["group"] == *group);
        assert_eq!(way["x_floor"]["p50"].is_f64(), compared, "{way}");
    }
    assert!(
        outcome["machine"]["kernel"]
            .as_str()
            .is_some_and(|kernel| !kernel.is_empty())
    );
    assert!(
        outcome["notes"]
            .as_array()
            .is_some_and(|notes| !notes.is_empty())
    );
}

#[test]
fn latencies_are_measured_on_every_way_beside_their_floors() {
    let outcome = bench(&["ipc", "--messages", "2000"]);
    judge(&outcome, &["polled", "waiting"]);
    assert_eq!(outcome["ways"].as_array().unwrap().len(), 11);
    let outcome = bench(&["loop", "--duration-s", "1"]);
    judge(&outcome, &["lateness", "compute"]);
    judge(
        &bench(&["inverse", "--rounds", "1"]),
        &["inverse", "forward"],
    );
}

#[test]
fn the_driver_and_a_bare_loop_share_the_wire_and_the_outcome_becomes_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = bench(&[
        "wire",
        "--duration-s",
        "1",
        "--output",
        folder.path().to_str().unwrap(),
    ]);
    judge(&outcome, &["set-point to set-point"]);
    let quantity = |name: &str| {
        let all = outcome["quantities"].as_array().unwrap();
        all.iter()
            .find(|quantity| quantity["name"] == name)
            .unwrap()["value"]
            .as_f64()
            .unwrap()
    };
    // The emulator paces bytes: nobody can be faster than the wire, and something must come
    // through.
    for name in ["a bare loop uses", "the driver uses"] {
        assert!(
            (1.0..103.0).contains(&quantity(name)),
            "{name}: {}",
            quantity(name)
        );
    }
    assert_eq!(quantity("rules broken by the host"), 0.0);
    for name in ["wire.json", "wire.hlog", "wire.svg", "index.html"] {
        assert!(
            fs::metadata(folder.path().join(name)).unwrap().len() > 500,
            "{name}"
        );
    }
}

#[test]
fn without_a_controller_there_is_no_way_from_end_to_end_and_that_is_said() {
    let output = program::output(&[
        "bench",
        "e2e",
        "--commands",
        "50",
        "--priority",
        "0",
        "--controller",
        "/nonexistent/i2ris-control",
    ]);
    let error = text(&output.stderr);
    assert!(
        !output.status.success() && error.contains("cannot start the controller"),
        "{error}"
    );
}

/// The controller is a program of another package, which is there after a build of the whole
/// workspace.
#[test]
fn a_command_is_followed_to_the_wire_and_back() {
    let controller = Path::new(env!("CARGO_BIN_EXE_i2ris-bench")).with_file_name("i2ris-control");
    if !controller.exists() {
        eprintln!("skipped: there is no {}", controller.display());
        return;
    }
    let outcome = bench(&[
        "e2e",
        "--commands",
        "80",
        "--controller",
        controller.to_str().unwrap(),
    ]);
    let arrived = "command to last byte of the set-point";
    let seen = "command to encoder position at the client";
    judge(&outcome, &[arrived, seen]);
    let p50 = |group: &str| {
        let ways = outcome["ways"].as_array().unwrap();
        let way = ways
            .iter()
            .find(|way| way["group"] == group && way["role"] == "ours")
            .unwrap();
        way["spans_ns"]["p50"].as_u64().unwrap()
    };
    // Causes come before effects, whatever the machine does.
    assert!(
        p50("command to operating system") < p50(arrived) && p50(arrived) < p50(seen),
        "{outcome}"
    );
}
