//! H15: two controllers. Ports and shared memory belong to one.

use i2ris::ipc::OperatingState;

use crate::rig::{Rig, settle, wait_for_end};

#[test]
fn h15_a_second_controller_is_refused_and_harms_nothing() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    let mut second = rig.spawn_controller("second");
    assert_eq!(
        wait_for_end(&mut second).expect("it ends at once").code(),
        Some(1)
    );
    let text = rig.said("second");
    assert!(
        text.starts_with("error: ") && text.lines().count() == 1,
        "{text}"
    );
    assert_eq!(
        settle(&mut client, |_| true).state,
        OperatingState::Enabled.number()
    );
}

/// The same ports under another name.
#[test]
fn h15_a_second_controller_in_another_domain_gets_no_port() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    let before = rig.emulator.log().len();
    let other = format!("{}-b", rig.domain().name());
    let domain = std::mem::replace(&mut rig.config.ipc.domain, other);
    let mut second = rig.spawn_controller("second");
    rig.config.ipc.domain = domain;
    assert_eq!(
        wait_for_end(&mut second).expect("it ends at once").code(),
        Some(1)
    );
    assert!(
        rig.said("second").contains("in use"),
        "{}",
        rig.said("second")
    );
    assert_eq!(
        settle(&mut client, |_| true).state,
        OperatingState::Enabled.number()
    );
    let kinds = rig.emulator.log().into_iter().skip(before);
    assert!(
        kinds
            .into_iter()
            .all(|event| !matches!(event.kind, i2ris_emulator::log::EventKind::Line(_)))
    );
}
