use super::*;

fn faulted() -> PortRig {
    let mut rig = PortRig::enabled();
    rig.drive(|drive| drive.fail(0x8611));
    rig.until(AxisPhase::Faulted);
    rig.turns(20);
    rig
}

fn reset(rig: &mut PortRig) {
    rig.request(|request| request.fault_resets += 1);
    let count = rig.newest(0).fault_resets;
    rig.until_feedback("acknowledges the reset", |feedback| feedback.fault_resets == count);
}

fn reset_until_disabled(rig: &mut PortRig) {
    reset(rig);
    rig.until(AxisPhase::Disabled);
}

#[test]
fn the_fault_is_named() {
    let mut rig = faulted();
    assert_eq!(rig.feedback().error_code, 0x8611);
    let mut texts = rig.events.iter().map(ToString::to_string);
    assert!(texts.any(|text| text.contains("motor 0: fault 0x8611 (following error)")));
}

#[test]
fn nothing_is_written_until_the_operator_resets() {
    let mut rig = faulted();
    rig.drive(|drive| drive.writes.clear());
    rig.turns(200);
    assert_eq!(rig.drive(|drive| drive.writes.len()), 0);
}

#[test]
fn a_reset_is_an_edge_and_ends_disabled() {
    let mut rig = faulted();
    rig.drive(|drive| drive.writes.clear());
    reset_until_disabled(&mut rig);
    assert_eq!(rig.controlwords(), [0x0000, 0x0080]);
    rig.turns(100);
    assert_eq!((rig.phase(), rig.feedback().error_code), (AxisPhase::Disabled, 0));
    assert!(rig.has_event(PortEventKind::FaultReset(true)));
}

#[test]
fn axis_is_enabled_again_only_after_demand_is_released() {
    let mut rig = faulted();
    reset_until_disabled(&mut rig);
    rig.release_and_enable();
    assert_eq!(rig.drive(|drive| drive.jumps), 0);
}

#[test]
fn fault_stays_while_cause_remains_until_second_reset() {
    let mut rig = faulted();
    rig.drive(|drive| drive.cause_remains = true);
    reset(&mut rig);
    assert_eq!(rig.phase(), AxisPhase::Faulted);
    assert!(rig.has_event(PortEventKind::FaultReset(false)));
    rig.drive(|drive| drive.cause_remains = false);
    reset_until_disabled(&mut rig);
}

#[test]
fn reset_without_fault_does_not_clear_later_fault() {
    let mut rig = PortRig::enabled();
    reset(&mut rig);
    rig.drive(|drive| drive.fail(0x3210));
    rig.until(AxisPhase::Faulted);
    rig.turns(200);
    assert_eq!(rig.phase(), AxisPhase::Faulted);
    assert!(!rig.controlwords().contains(&0x0080));
}

#[test]
fn a_fault_at_start_is_reported_and_can_be_reset() {
    let mut drive = one_drive();
    drive.fail(0x8120);
    let mut rig = PortRig::new(vec![drive]);
    rig.until(AxisPhase::Faulted);
    rig.turns(4);
    assert_eq!(rig.feedback().error_code, 0x8120);
    reset_until_disabled(&mut rig);
}

#[test]
fn position_loss_fault_unhomes_axis_despite_drive_bit() {
    let mut rig = PortRig::enabled();
    assert!(rig.feedback().homed);
    rig.drive(|drive| drive.fail(0x7380));
    rig.until(AxisPhase::Faulted);
    rig.turns(20);
    assert!(!rig.feedback().homed);
    reset_until_disabled(&mut rig);
    rig.turns(100);
    assert!(rig.drive(|drive| drive.homed), "the bit of the drive stays");
    assert!(!rig.feedback().homed);
    rig.demand(Demand::Disabled);
    rig.turns(20);
    rig.start_homing();
    rig.until_feedback("is homed", |feedback| feedback.homed);
}
