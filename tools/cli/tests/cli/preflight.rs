//! `i2ris preflight` on emulated drives and a snake whose model was fitted.

use std::sync::atomic::Ordering;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris::units::Nanos;
use i2ris_report::preflight::Preflight;
use i2ris_simulation::ageing::{Change, Course, Parameter};
use i2ris_testing::{Rig, TIMEOUT, Terminal, wait_for};
use serde_json::Value;

use crate::bench::{assert_says, end, expect_stalls, run, start, succeeds};

/// What is no go, by name, and everything that was said. A machine that stalls is no failure of a
/// robot.
fn no_go(domain: &Domain) -> (Vec<String>, String) {
    loop {
        let said = run(domain, "preflight --enable --json");
        let report: Value = serde_json::from_str(&said.output).unwrap();
        if said.output.contains("commands came late") {
            continue;
        }
        let checks = report["checks"].as_array().unwrap().iter();
        let failed = checks.filter(|check| check["level"] == "fail");
        let names = failed.map(|check| check["name"].as_str().unwrap().to_owned());
        let of_machine = ["line", "disk"];
        return (names.filter(|name| !of_machine.contains(&&**name)).collect(), said.output);
    }
}

#[test]
fn without_a_camera_a_person_is_asked_what_was_seen() {
    let mut rig = Rig::with_fitted_model();
    expect_stalls(&mut rig);
    rig.camera_is_shut.store(true, Ordering::Relaxed);
    rig.start_controller();
    drop(rig.client());
    let domain = rig.domain();
    for words in ["home", "enable", "command state condition"] {
        succeeds(&domain, words);
    }
    let (named, said) = no_go(&domain);
    assert_eq!(named, ["watchdog", "motion"], "{said}");
    assert_says(&said, &["nobody and no camera has seen it"]);
    for (answer, outcome) in
        [("no\n", "something else than was expected"), ("yes\n", "by eye only")]
    {
        let mut terminal = Terminal::start(&domain, &["preflight"], 50, 160);
        terminal.wait_for("one hand on the switch");
        terminal.type_keys("yes\n");
        terminal.wait_for("Did the tip swing");
        terminal.type_keys(answer);
        terminal.wait_for(outcome);
        // Nothing watches the controller here.
        assert_eq!(terminal.end().code(), Some(1));
    }
}

/// A robot with a model whose memory is known, ENABLED, and nothing that compares it with a camera.
fn conditioned() -> (Rig, Client) {
    let mut rig = Rig::with_fitted_model();
    expect_stalls(&mut rig);
    rig.config.limits.plausibility_deg = 0.0;
    rig.start_controller();
    let client = rig.client();
    for words in ["home", "enable", "command state condition"] {
        succeeds(&rig.domain(), words);
    }
    (rig, client)
}

#[test]
fn a_preflight_moves_by_permission_names_what_is_wrong_and_is_kept_for_the_trial() {
    let (rig, mut client) = conditioned();
    let domain = rig.domain();
    let (said, is_go) = Preflight::before_trial(&domain, clock::now());
    assert!(!is_go && said.contains("no preflight"), "{said}");
    let begin = clock::now();
    let refused = run(&domain, "preflight");
    assert_eq!(refused.code, Some(1));
    assert_says(&refused.error, &["no-go: ", "motion", "watchdog"]);
    assert_says(&refused.output, &["nobody can be asked here"]);
    assert!(!rig.moved_since(begin), "nothing moves before it is permitted");
    succeeds(&domain, "command state pause");
    let begin = clock::now();
    assert_says(&no_go(&domain).1, &["somebody has paused the robot"]);
    assert!(!rig.moved_since(begin), "a pause is for who has paused");
    succeeds(&domain, "command state resume");
    let operator = start(&domain, "command circle --radius-deg 1 --period-s 4 --duration-s 6");
    wait_for(&mut client, |state| state.lease_client_id != 0 && state.accepted > 50);
    assert_says(&no_go(&domain).1, &["holds the lease; end that program first"]);
    let said = end(operator);
    assert_eq!(said.code, Some(0), "{}", said.error);
    let (named, said) = no_go(&domain);
    assert_eq!(named, ["watchdog"], "{said}");
    let largest = rig.emulator.snapshot().angles_deg;
    assert!(largest.iter().all(|angle| angle.abs() < 2.0), "{largest:?}");
    rig.emulator.begin_ageing(Change {
        parameter: Parameter::Gap,
        by: 3.0,
        start_s: 0.0,
        motor: Some(1),
        direction: None,
        course: Course::Step {},
    });
    let (named, said) = no_go(&domain);
    assert_eq!(named, ["watchdog", "wire"], "{said}");
    let (said, is_go) = Preflight::before_trial(&domain, clock::now());
    assert!(!is_go && said.contains("NO-GO (") && said.contains("wire"), "{said}");
}

#[test]
fn a_camera_that_dies_in_the_swing_ends_it() {
    let (rig, mut client) = conditioned();
    let domain = rig.domain();
    let accepted = client.wait_for(TIMEOUT, |_| true).unwrap().accepted;
    let program = start(&domain, "preflight --enable");
    wait_for(&mut client, |state| state.accepted > accepted + 50);
    rig.camera_is_shut.store(true, Ordering::Relaxed);
    let shut = clock::now();
    let said = end(program);
    assert_says(&said.output, &["the camera has shown no angle for 1 s"]);
    assert_says(&said.error, &["no-go: ", "motion"]);
    // The whole motion takes half a minute, and is seen in the state after it.
    assert!(!rig.moved_since(shut + Nanos::from_millis(5000)));
}
