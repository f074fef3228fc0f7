use super::*;

#[test]
fn position_status_error_and_current_are_reported() {
    let mut rig = PortRig::disabled();
    rig.drive(|drive| drive.position = -7);
    rig.turns(40);
    let feedback = rig.feedback();
    assert_eq!((feedback.position, feedback.current_ma), (Counts(-7), 12));
    assert_eq!((feedback.statusword, feedback.error_code), (0x8240, 0));
    assert_eq!((feedback.phase, feedback.homed), (AxisPhase::Disabled, true));
    assert!(feedback.counters.exchanges > 40);
    assert_eq!(feedback.written, None);
    assert!(rig.line.time().duration_since(feedback.stamp) < Nanos::from_millis(10));
}

#[test]
fn almost_every_other_exchange_is_a_position() {
    let mut rig = PortRig::disabled();
    rig.turns(20);
    let before = rig.feedback().sequence;
    rig.turns(20);
    let read = rig.feedback().sequence - before;
    assert!((8..=10).contains(&read), "{read}");
}

#[test]
fn nothing_is_written() {
    for demand in [Demand::Disabled, Demand::QuickStop] {
        let mut rig = PortRig::disabled();
        rig.drive(|drive| drive.writes.clear());
        rig.request(|request| (request.demand, request.target) = (demand, Counts(50)));
        rig.turns(100);
        assert!(rig.drive(|drive| drive.writes.is_empty()));
        assert_eq!(rig.phase(), AxisPhase::Disabled);
    }
}

#[test]
fn a_drive_that_someone_else_enables_is_switched_off() {
    let mut rig = PortRig::disabled();
    rig.drive(|drive| drive.state = OPERATION_ENABLED);
    rig.until(AxisPhase::Disabling);
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.controlwords(), [0x0007, 0x0006]);
    assert!(rig.count_events(|kind| matches!(kind, PortEventKind::UnexpectedState(_))) > 0);
}

#[test]
fn refused_current_read_is_reported_once_without_other_effect() {
    let mut rig = PortRig::disabled();
    rig.drive(|drive| drive.objects.remove(&(0x30D1, 2)));
    rig.turns(200);
    let refusals = rig.count_events(|kind| matches!(kind, PortEventKind::Refused { .. }));
    assert_eq!((refusals, rig.phase()), (1, AxisPhase::Disabled));
}

#[test]
fn impossible_position_jump_loses_zero() {
    for (is_enabled, jump) in [(false, 22), (false, -120), (true, 250), (true, -250)] {
        let mut rig = PortRig::with(vec![one_drive()], |port| port.axes[0].motor_speed_rpm = 200);
        rig.until(AxisPhase::Disabled);
        if is_enabled {
            rig.enable(0);
            rig.until(AxisPhase::Enabled);
        }
        for step in 1..100 {
            rig.drive(|drive| drive.position += 5);
            rig.turns(2);
            assert!(rig.feedback().homed, "{step} small steps");
        }
        rig.turns(10);
        rig.drive(|drive| drive.position += jump);
        rig.turns(10);
        assert!(!rig.feedback().homed, "{jump}");
        let is_mismatch =
            |kind: &PortEventKind| matches!(kind, PortEventKind::PositionMismatch { .. });
        assert_eq!(rig.count_events(is_mismatch), 1);
    }
}
