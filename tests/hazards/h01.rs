//! H01: a stale target in the drive at enable.

use i2ris::clock;
use i2ris::ipc::{OperatingState, StateCommand};
use i2ris::units::Nanos;
use i2ris_emulator::drive::State;
use i2ris_emulator::log::EventKind;

use crate::rig::motion::stream_counts;
use crate::rig::{Rig, enable, settle_in, wait_until_idle};

/// The last target of the drive is 300; a new zero then places the motor elsewhere.
#[test]
fn h01_a_stale_target_is_replaced_before_the_drive_is_enabled() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    stream_counts(&client, 1.5, |t| [(300.0 * t).min(300.0) as i32, 0]);
    client.state_command(StateCommand::Disable).unwrap();
    settle_in(&mut client, OperatingState::Disabled);
    client.state_command(StateCommand::Home).unwrap();
    wait_until_idle(&mut client);
    let before = rig.emulator.snapshot().axes[0].drive;
    assert!(before.position.abs() <= 2, "here is zero: {before:?}");
    let events = rig.emulator.log().len();
    enable(&mut client);
    clock::sleep(Nanos::from_millis(300));
    let after = rig.emulator.snapshot().axes[0].drive;
    let moved = (after.position - before.position).abs();
    assert!(moved <= 2 && after.target.abs() <= 2, "{before:?} {after:?}");
    let since = rig.emulator.log().into_iter().skip(events).filter(|event| event.axis == 0);
    let since: Vec<EventKind> = since.map(|event| event.kind).collect();
    let is_target = |kind: &EventKind| matches!(kind, EventKind::Setpoint(_));
    let is_enabled = |kind: &EventKind| {
        let enabled = State::OperationEnabled;
        matches!(kind, EventKind::State { to, .. } if *to == enabled)
    };
    let first_target = since.iter().position(is_target).unwrap();
    let enabled = since.iter().position(is_enabled).unwrap();
    assert!(first_target < enabled, "the target comes before the power: {since:?}");
    for kind in &since {
        let far = matches!(kind, EventKind::Setpoint(counts) if counts.abs() > 2);
        assert!(!far, "every target is the present position: {since:?}");
    }
}
