//! H15: two controllers. Ports and shared memory belong to one.

use i2ris::ipc::OperatingState;
use i2ris_simulation::log::EventKind;
use i2ris_testing::{Rig, wait_for_end, wait_until_idle};

/// Starts a second controller on a domain and returns the text of its refusal. The first controller
/// stays enabled.
fn refusal_of_second(change_domain: impl FnOnce(&mut String)) -> String {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    let events = rig.emulator.log().len();
    let domain = rig.config.domain.clone();
    change_domain(&mut rig.config.domain);
    let mut second = rig.spawn_controller("second");
    rig.config.domain = domain;
    assert_eq!(wait_for_end(&mut second).code(), Some(1));
    let state = wait_until_idle(&mut client).state;
    assert_eq!(state, OperatingState::Enabled.number());
    let log = rig.emulator.log();
    assert!(!log[events..].iter().any(|event| matches!(event.kind, EventKind::Line(_))));
    let text = rig.log_text("second");
    assert!(text.starts_with("error: ") && text.lines().count() == 1, "{text}");
    text
}

#[test]
fn h15_a_second_controller_is_refused_and_changes_nothing() {
    let text = refusal_of_second(|_| {});
    assert!(text.contains("already"), "{text}");
}

#[test]
fn h15_a_second_controller_in_another_domain_gets_no_port() {
    let text = refusal_of_second(|domain| domain.push_str("-b"));
    assert!(text.contains("in use"), "{text}");
}
