use super::*;

fn home(rig: &mut Rig) {
    rig.request(|request| request.homings += 1);
    let count = rig.requests[0].homings;
    rig.until_it("answers the homing", |feedback| feedback.homings == count);
}

fn not_homed() -> Rig {
    let mut rig = Rig::disabled();
    rig.drive(|drive| {
        drive.homed = false;
        drive.position = 3456;
        drive.writes.clear();
    });
    rig.turns(20);
    rig
}

#[test]
fn here_becomes_zero_and_the_axis_ends_disabled_in_the_streaming_mode() {
    let mut rig = not_homed();
    assert!(!rig.feedback().homed);
    home(&mut rig);
    let feedback = rig.feedback();
    assert_eq!(
        (feedback.phase, feedback.homed, feedback.position),
        (AxisPhase::Disabled, true, Counts(0))
    );
    assert_eq!(
        rig.controlwords(),
        [0x0006, 0x000F, 0x001F, 0x000F, 0x0007, 0x0006]
    );
    assert_eq!(rig.drive(|drive| drive.written(0x6060, 0)), [6, 8]);
    assert_eq!(rig.drive(|drive| drive.written(0x6098, 0)), [37]);
    assert!(
        rig.kinds()
            .contains(&PortEventKind::HomingEnded { failure: None })
    );
}

#[test]
fn a_drive_that_refuses_a_target_outside_its_limits_is_homed_all_the_same() {
    let mut rig = not_homed();
    rig.drive(|drive| drive.refuses.insert((0x607A, 0), 0x0609_0030));
    home(&mut rig);
    assert!(rig.feedback().homed);
}

#[test]
fn it_can_be_enabled_afterwards() {
    let mut rig = not_homed();
    home(&mut rig);
    rig.demand(Demand::Disabled);
    rig.turns(1);
    rig.demand(Demand::Enabled);
    rig.until(AxisPhase::Enabled);
    assert_eq!(rig.drive(|drive| drive.jumps), 0);
}

#[test]
fn an_error_ends_it_switched_off() {
    let mut rig = not_homed();
    rig.drive(|drive| drive.homing_fails = true);
    home(&mut rig);
    rig.until(AxisPhase::Disabled);
    assert!(!rig.feedback().homed);
    assert!(rig.kinds().contains(&PortEventKind::HomingEnded {
        failure: Some(Failure::HomingError)
    }));
    assert_eq!(rig.controlwords().last(), Some(&0x0006));
}

#[test]
fn a_start_that_was_not_acknowledged_is_not_repeated() {
    let mut rig = not_homed();
    rig.bench.world().ambush = Some((0x6040, 0x001F, Mischief::LoseReply));
    rig.request(|request| request.homings += 1);
    rig.until(AxisPhase::Homing);
    rig.until(AxisPhase::Disabled);
    assert_eq!(
        rig.controlwords()
            .iter()
            .filter(|word| **word == 0x001F)
            .count(),
        1
    );
    assert!(rig.kinds().contains(&PortEventKind::HomingEnded {
        failure: Some(Failure::Interrupted)
    }));
    assert_eq!(rig.feedback().homings, 1);
}

#[test]
fn it_is_refused_while_enabled_and_not_kept_for_later() {
    let mut rig = Rig::enabled();
    home(&mut rig);
    assert!(rig.kinds().contains(&PortEventKind::HomingRefused));
    rig.demand(Demand::Disabled);
    rig.until(AxisPhase::Disabled);
    rig.turns(100);
    assert!(!rig.controlwords().contains(&0x001F));
}

#[test]
fn quick_stop_interrupts_it() {
    let mut rig = not_homed();
    rig.request(|request| request.homings += 1);
    rig.until(AxisPhase::Homing);
    rig.turns(8);
    rig.demand(Demand::QuickStop);
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.feedback().homings, 1);
    assert!(rig.kinds().contains(&PortEventKind::HomingEnded {
        failure: Some(Failure::Interrupted)
    }));
}

#[test]
fn a_restart_in_the_middle_ends_it_without_a_start_in_another_mode() {
    for turns in 0..50 {
        let mut rig = not_homed();
        rig.request(|request| request.homings += 1);
        rig.turns(turns);
        rig.bench.restart(NODE, Nanos::from_millis(60));
        rig.turns(300);
        rig.drive(|drive| {
            assert!(
                matches!(drive.state, SWITCH_ON_DISABLED | READY),
                "after {turns} turns"
            )
        });
        let starts = rig.drive(|drive| drive.starts_outside_homing);
        assert_eq!(starts, 0, "after {turns} turns");
    }
}

#[test]
fn a_start_whose_reply_is_damaged_is_not_repeated_either() {
    let mut rig = not_homed();
    rig.bench.world().ambush = Some((0x6040, 0x001F, Mischief::FlipReply(7)));
    rig.request(|request| request.homings += 1);
    rig.until(AxisPhase::Homing);
    rig.until(AxisPhase::Disabled);
    assert_eq!(
        rig.controlwords()
            .iter()
            .filter(|word| **word == 0x001F)
            .count(),
        1
    );
    assert!(rig.kinds().contains(&PortEventKind::HomingEnded {
        failure: Some(Failure::Unanswered)
    }));
}

#[test]
fn a_homing_mode_that_does_not_come_into_force_starts_nothing() {
    let mut rig = not_homed();
    rig.drive(|drive| drive.mode_stuck = true);
    home(&mut rig);
    rig.until(AxisPhase::Disabled);
    assert!(
        rig.controlwords()
            .iter()
            .all(|word| *word != 0x000F && *word != 0x001F),
        "{:X?}",
        rig.controlwords()
    );
}
