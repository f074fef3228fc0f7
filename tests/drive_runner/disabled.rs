use super::*;

#[test]
fn position_status_error_and_current_are_reported() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| drive.position = -7);
    rig.turns(40);
    let feedback = rig.feedback();
    assert_eq!(
        (feedback.position, feedback.current_ma, feedback.error_code),
        (Counts(-7), 12, 0)
    );
    assert_eq!((feedback.statusword, feedback.homed), (0x8240, true));
    assert_eq!(feedback.phase, AxisPhase::Disabled);
    assert!(feedback.counters.exchanges > 40);
    assert_eq!(feedback.written, None);
    assert!(rig.bench.time().since(feedback.stamp) < Nanos::from_millis(10));
}

#[test]
fn every_position_counts_up_by_one() {
    let mut rig = Rig::disabled();
    let before = rig.feedback().sequence;
    rig.turns(20);
    assert_eq!(
        rig.feedback().sequence,
        before + 10,
        "every other exchange is a position"
    );
}

#[test]
fn nothing_is_written() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| drive.writes.clear());
    rig.request(|request| request.target = Counts(50));
    rig.turns(100);
    assert!(rig.drive(|drive| drive.writes.is_empty()));
}

#[test]
fn a_drive_that_someone_else_enables_is_switched_off() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| drive.state = OPERATION_ENABLED);
    rig.until_it("switches off", |feedback| {
        feedback.phase == AxisPhase::Disabling
    });
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.controlwords(), [0x0007, 0x0006]);
    assert!(
        rig.kinds()
            .iter()
            .any(|kind| matches!(kind, PortEventKind::StateLost { .. }))
    );
}

#[test]
fn a_refused_current_is_reported_once_and_harms_nothing() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| drive.objects.remove(&(0x30D1, 2)));
    rig.turns(200);
    let refusals = rig
        .kinds()
        .into_iter()
        .filter(|kind| matches!(kind, PortEventKind::Refused { .. }))
        .count();
    assert_eq!((refusals, rig.feedback().phase), (1, AxisPhase::Disabled));
}
