//! `i2ris preflight` on emulated drives and a snake whose model was fitted.

use std::sync::atomic::Ordering;

use i2ris::{clock, ipc::Domain, ipc::client::Client, units::Nanos};
use i2ris_report::preflight::Preflight;
use i2ris_simulation::ageing::{Change, Course, Parameter};
use i2ris_testing::bench::{assert_says, end, ends, expect_stalls, fails, run, start, succeeds};
use i2ris_testing::{Rig, TIMEOUT, Terminal, wait_for};
use serde_json::Value;

/// The failed checks, by name, and the whole output. Repeated if the machine stalls.
fn no_go(domain: &Domain) -> (Vec<String>, String) {
    for _ in 0..10 {
        let result = run(domain, "preflight --enable --json");
        let report: Value = serde_json::from_str(&result.output).unwrap();
        if ["came late", "ms old in the motion"].iter().any(|it| result.output.contains(it)) {
            continue;
        }
        let checks = report["checks"].as_array().unwrap().iter();
        let failed = checks.filter(|check| check["level"] == "fail");
        let names = failed.map(|check| check["name"].as_str().unwrap().to_owned());
        let of_machine = ["line", "disk"];
        return (names.filter(|name| !of_machine.contains(&&**name)).collect(), result.output);
    }
    panic!("the machine stalls too often");
}

fn conditioned(change: impl FnOnce(&mut Rig)) -> (Rig, Client) {
    let mut rig = Rig::with_fitted_model();
    expect_stalls(&mut rig);
    change(&mut rig);
    rig.start_controller();
    let client = rig.client();
    for words in ["home", "enable", "command state condition"] {
        succeeds(&rig.domain(), words);
    }
    (rig, client)
}

fn without_comparison(rig: &mut Rig) {
    rig.config.limits.plausibility_deg = 0.0;
}

/// A person without a camera answers whether the tip swings. Repeated if the machine stalls.
fn asked(domain: &Domain, answer: &str, outcome: &str) {
    let asks = "Did the tip swing";
    let mut terminal = (0..10).map(|_| {
        let mut terminal = Terminal::start(domain, &["preflight"], 50, 160);
        terminal.wait_for("one hand on the switch");
        terminal.type_keys("yes\n");
        terminal.wait(asks, |text| text.contains(asks) || text.contains("error: "));
        terminal
    });
    let mut terminal = terminal.find(|it| it.screen.screen().contents().contains(asks)).unwrap();
    terminal.type_keys(answer);
    terminal.wait_for(outcome);
    // Nothing watches the controller here.
    assert_eq!(terminal.end().code(), Some(1));
}

#[test]
fn without_a_camera_a_person_is_asked_or_it_is_no_go() {
    let (rig, _client) = conditioned(|rig| rig.camera_is_shut.store(true, Ordering::Relaxed));
    let (named, result) = no_go(&rig.domain());
    assert_eq!(named, ["watchdog", "motion"], "{result}");
    assert_says(&result, &["seen by neither operator nor camera"]);
    asked(&rig.domain(), "no\n", "did not see the expected motion");
    asked(&rig.domain(), "yes\n", "by eye only");
}

#[test]
fn preflight_moves_by_permission() {
    let (rig, mut client) = conditioned(without_comparison);
    let domain = rig.domain();
    let (result, is_go) = Preflight::before_trial(&domain, clock::now());
    assert!(!is_go && result.contains("no preflight"), "{result}");
    let begin = clock::now();
    let refused = fails(&domain, "preflight", 1, &["no-go: ", "motion", "watchdog"]);
    assert_says(&refused.output, &["no operator to ask here"]);
    assert!(!rig.moved_since(begin), "nothing moves before it is permitted");
    succeeds(&domain, "command state pause");
    let begin = clock::now();
    assert_says(&no_go(&domain).1, &["a client has paused the robot"]);
    assert!(!rig.moved_since(begin), "a pause belongs to the client that has paused");
    succeeds(&domain, "command state resume");
    let operator = start(&domain, "command circle --radius-deg 1 --period-s 4 --duration-s 6");
    wait_for(&mut client, |state| state.lease_client_id != 0 && state.accepted > 50);
    assert_says(&no_go(&domain).1, &["holds the lease; end that program first"]);
    ends(operator, 0, &[]);
    let (named, result) = no_go(&domain);
    assert_eq!(named, ["watchdog"], "{result}");
    let largest = rig.emulator.snapshot().angles_deg;
    assert!(largest.iter().all(|angle| angle.abs() < 2.0), "{largest:?}");
}

#[test]
fn preflight_names_a_fault_and_is_stored() {
    let (rig, _client) = conditioned(without_comparison);
    let domain = rig.domain();
    let (parameter, course) = (Parameter::Gap, Course::Step {});
    let (motor, direction) = (Some(1), None);
    let change = Change { parameter, by: 3.0, start_s: 0.0, motor, direction, course };
    rig.emulator.begin_ageing(change);
    let (named, result) = no_go(&domain);
    assert_eq!(named, ["watchdog", "wire"], "{result}");
    let (result, is_go) = Preflight::before_trial(&domain, clock::now());
    assert!(!is_go && result.contains("NO-GO (") && result.contains("wire"), "{result}");
}

#[test]
fn a_camera_that_dies_in_the_swing_ends_it() {
    let (rig, mut client) = conditioned(without_comparison);
    let domain = rig.domain();
    let accepted = client.wait_for(TIMEOUT, |_| true).unwrap().accepted;
    let program = start(&domain, "preflight --enable");
    wait_for(&mut client, |state| state.accepted > accepted + 50);
    rig.camera_is_shut.store(true, Ordering::Relaxed);
    let shut = clock::now();
    let result = end(program);
    assert_says(&result.output, &["the camera has shown no angle for 1 s"]);
    assert_says(&result.error, &["no-go: ", "motion"]);
    // The whole motion takes half a minute, and shows in the state after it.
    assert!(!rig.moved_since(shut + Nanos::from_millis(5000)));
}
