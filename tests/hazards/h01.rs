//! H01: a stale target in the drive at enable.

use i2ris::ipc::StateCommand;
use i2ris_emulator::drive::State;
use i2ris_emulator::log::EventKind;

use crate::live::stream_counts;
use crate::rig::{Rig, enable, settle};

/// The last target of the drive is 300; meanwhile the motor is elsewhere, because the drive knows
/// another zero.
#[test]
fn h01_a_stale_target_is_replaced_before_the_drive_is_enabled() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    stream_counts(&client, 1.5, |t| [(300.0 * t).min(300.0) as i32, 0]);
    client.state_command(StateCommand::Disable).unwrap();
    settle(&mut client, |state| state.state == 0);
    client.state_command(StateCommand::Home).unwrap();
    settle(&mut client, |_| true);
    let before = rig.emulator.snapshot().axes[0].drive;
    assert!(before.position.abs() <= 2, "here is zero: {before:?}");
    let events = rig.emulator.log().len();
    enable(&mut client);
    i2ris::clock::sleep(i2ris::units::Nanos::from_millis(300));
    let after = rig.emulator.snapshot().axes[0].drive;
    assert!(
        (after.position - before.position).abs() <= 2 && after.target.abs() <= 2,
        "{before:?} {after:?}"
    );
    let since: Vec<EventKind> = rig
        .emulator
        .log()
        .into_iter()
        .skip(events)
        .filter(|event| event.axis == 0)
        .map(|event| event.kind)
        .collect();
    let first_target = since
        .iter()
        .position(|kind| matches!(kind, EventKind::Setpoint(_)));
    let enabled = since
        .iter()
        .position(|kind| {
            matches!(
                kind,
                EventKind::State {
                    to: State::OperationEnabled,
                    ..
                }
            )
        })
        .unwrap();
    assert!(
        first_target.is_some_and(|target| target < enabled),
        "the target comes before the power: {since:?}"
    );
    assert!(
        since
            .iter()
            .all(|kind| !matches!(kind, EventKind::Setpoint(counts) if counts.abs() > 2)),
        "no target but where it stands: {since:?}"
    );
}
