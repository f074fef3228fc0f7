use super::*;

fn lost() -> PortRig {
    let mut rig = PortRig::enabled();
    rig.line.state().silent = true;
    rig.until(AxisPhase::Lost);
    rig
}

/// Events whose text contains this.
fn texts(rig: &PortRig, part: &str) -> Vec<String> {
    let mut texts: Vec<_> = rig.events.iter().map(ToString::to_string).collect();
    texts.retain(|text| text.contains(part));
    texts
}

#[test]
fn a_silent_line_is_lost_before_the_control_loop_faults() {
    let mut rig = PortRig::enabled();
    let begin = rig.line.time();
    rig.line.state().silent = true;
    rig.until(AxisPhase::Lost);
    assert!(rig.line.time().duration_since(begin) < Nanos::from_millis(400));
}

#[test]
fn restarted_drive_reconnects_disabled_and_with_limits() {
    for demand in [Demand::Enabled, Demand::QuickStop] {
        let mut rig = lost();
        rig.demand(demand);
        rig.turns(100);
        assert_eq!(rig.phase(), AxisPhase::Lost);
        rig.drive(MiniDrive::restart);
        rig.reconnect_until(AxisPhase::Disabled);
        assert_eq!(rig.drive(|drive| drive.objects[&(0x607D, 2)]), 2000);
        rig.turns(200);
        assert_eq!(rig.phase(), AxisPhase::Disabled);
        rig.release_and_enable();
    }
}

#[test]
fn drive_that_stayed_enabled_is_switched_off_cleanly() {
    let mut rig = lost();
    assert_eq!(rig.state(), OPERATION_ENABLED);
    rig.drive(|drive| drive.writes.clear());
    rig.reconnect_until(AxisPhase::Disabled);
    assert_eq!(rig.controlwords(), [0x0007, 0x0006]);
}

#[test]
fn powered_drive_holds_on_reconnection_during_fault() {
    let mut rig = lost();
    rig.demand(Demand::QuickStop);
    rig.drive(|drive| drive.writes.clear());
    rig.reconnect_until(AxisPhase::QuickStopped);
    rig.turns(2000);
    assert_eq!((rig.phase(), rig.state()), (AxisPhase::QuickStopped, QUICK_STOP_ACTIVE));
    assert_eq!(rig.controlwords(), [0x000B]);
    assert!(rig.feedback().homed, "the same zero");
    rig.demand_until(Demand::Disabled, AxisPhase::Disabled);
    rig.release_and_enable();
}

#[test]
fn different_drive_on_same_cable_is_refused_and_reported_once() {
    let mut rig = lost();
    rig.line.state().drives = vec![MiniDrive::new(NODE, 0xBAD)];
    rig.line.state().silent = false;
    rig.turns(2000);
    assert_eq!(rig.phase(), AxisPhase::Lost);
    let texts = texts(&rig, "not usable");
    assert_eq!(texts.len(), 1, "{texts:?}");
    assert!(texts[0].contains("0x00000BAD") && texts[0].contains("0x62150001"), "{texts:?}");
}

#[test]
fn unplugged_cable_is_lost_immediately_without_busy_loop() {
    let mut rig = PortRig::enabled();
    rig.line.state().hung_up = true;
    rig.turns(1);
    assert_eq!(rig.phase(), AxisPhase::Lost);
    let begin = rig.line.time();
    rig.turns(100);
    assert!(rig.line.time().duration_since(begin) >= Nanos::from_millis(1000));
}

#[test]
fn reset_or_homing_requested_while_lost_is_dropped() {
    let mut rig = lost();
    rig.request(|request| {
        request.fault_resets += 1;
        request.homings += 1;
    });
    rig.turns(10);
    let feedback = rig.feedback();
    assert_eq!((feedback.fault_resets, feedback.homings), (1, 1));
    rig.reconnect_until(AxisPhase::Disabled);
    rig.turns(100);
    assert!(!rig.controlwords().contains(&0x001F));
}

#[test]
fn unknown_statusword_loses_axis_until_known_again() {
    let mut rig = PortRig::enabled();
    rig.drive(|drive| drive.state = 0x0201);
    rig.until(AxisPhase::Lost);
    rig.turns(500);
    assert_eq!(rig.phase(), AxisPhase::Lost);
    assert_eq!(texts(&rig, "is not a known state").len(), 1);
    rig.drive(|drive| drive.state = OPERATION_ENABLED);
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.state(), READY);
}

/// Enables an axis at its position, as the control loop does.
fn enable_where_it_is(rig: &mut PortRig) {
    let position = rig.feedback().position;
    rig.request(|request| request.target = position);
    rig.release_and_enable();
}

#[test]
fn drive_lost_for_ten_seconds_does_not_jump_on_return() {
    let mut rig = PortRig::enabled();
    rig.turns(20);
    let position = rig.drive(|drive| drive.position);
    rig.line.state().silent = true;
    let end = rig.line.time() + Nanos::from_millis(10_000);
    let mut target = position;
    while rig.line.time() < end {
        target += 1;
        rig.enable(target);
        rig.turns(1);
    }
    assert_eq!(rig.phase(), AxisPhase::Lost);
    rig.line.state().silent = false;
    for _ in 0..2000 {
        target += 1;
        rig.enable(target);
        rig.turns(1);
    }
    assert_eq!(rig.phase(), AxisPhase::Disabled, "until a person enables it");
    assert_eq!(rig.drive(|drive| drive.position), position);
    enable_where_it_is(&mut rig);
    rig.turns(20);
    assert_eq!(rig.drive(|drive| (drive.position, drive.jumps)), (position, 0));
}

#[test]
fn thousand_faults_with_lost_line_recover_without_jump() {
    let mut rig = PortRig::enabled();
    rig.turns(20);
    let position = rig.drive(|drive| drive.position);
    for round in 0..1000 {
        rig.drive(|drive| drive.fail(0x2310));
        rig.until(AxisPhase::Faulted);
        // Before, during and after the reset, by the round.
        for step in 0..3 {
            if step == round % 3 {
                rig.line.state().silent = true;
                rig.until(AxisPhase::Lost);
                rig.line.state().silent = false;
                rig.until_feedback("is back", |feedback| feedback.phase != AxisPhase::Lost);
            }
            if step == 1 {
                rig.request(|request| request.fault_resets += 1);
            }
            rig.turns(5);
        }
        if rig.phase() == AxisPhase::Faulted {
            rig.request(|request| request.fault_resets += 1);
        }
        rig.until(AxisPhase::Disabled);
        enable_where_it_is(&mut rig);
        assert_eq!(
            rig.drive(|drive| (drive.position, drive.jumps)),
            (position, 0),
            "round {round}"
        );
    }
}
