//! `i2ris preflight` on emulated drives and a snake whose model was fitted.

use std::sync::atomic::Ordering;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris_report::preflight::Preflight;
use i2ris_simulation::ageing::{Change, Course, Parameter};
use i2ris_testing::{Rig, Terminal};
use serde_json::Value;

use crate::bench::{assert_says, expect_stalls, run, succeeds};

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

#[test]
fn a_preflight_moves_by_permission_names_what_is_wrong_and_is_kept_for_the_trial() {
    let mut rig = Rig::with_fitted_model();
    expect_stalls(&mut rig);
    rig.config.limits.plausibility_deg = 0.0;
    rig.start_controller();
    drop(rig.client());
    let domain = rig.domain();
    let (said, is_go) = Preflight::before_trial(&domain, clock::now());
    assert!(!is_go && said.contains("no preflight"), "{said}");
    for words in ["home", "enable", "command state condition"] {
        succeeds(&domain, words);
    }
    let begin = clock::now();
    let refused = run(&domain, "preflight");
    assert_eq!(refused.code, Some(1));
    assert_says(&refused.error, &["no-go: ", "motion", "watchdog"]);
    assert_says(&refused.output, &["nobody can be asked here"]);
    assert!(!rig.moved_since(begin), "nothing moves before it is permitted");
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
