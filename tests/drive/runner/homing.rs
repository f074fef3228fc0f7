use i2ris::config::HomingMethod;

use super::*;

fn home(rig: &mut PortRig) {
    rig.start_homing();
    let count = rig.newest(0).homings;
    rig.until_feedback("ends homing", |feedback| feedback.homings == count);
}

fn not_homed() -> PortRig {
    let mut rig = PortRig::disabled();
    rig.drive(|drive| {
        drive.homed = false;
        drive.position = 3456;
        drive.writes.clear();
    });
    rig.turns(20);
    rig
}

fn failed_with(error: TransitionError) -> PortEventKind {
    PortEventKind::HomingEnded(Some(error))
}

#[test]
fn homing_sets_present_position_to_zero_and_ends_disabled() {
    let mut rig = not_homed();
    assert!(!rig.feedback().homed);
    home(&mut rig);
    let feedback = rig.feedback();
    assert_eq!((feedback.phase, feedback.homed), (AxisPhase::Disabled, true));
    assert_eq!(feedback.position, Counts(0));
    assert_eq!(rig.controlwords(), [0x0006, 0x000F, 0x001F, 0x000F, 0x0007, 0x0006]);
    assert_eq!(rig.drive(|drive| drive.written(0x6060, 0)), [6, 8]);
    assert_eq!(rig.drive(|drive| drive.written(0x6098, 0)), [37]);
    assert!(rig.has_event(PortEventKind::HomingEnded(None)));
    rig.release_and_enable();
    assert_eq!(rig.drive(|drive| drive.jumps), 0);
}

#[test]
fn drive_that_checks_target_limits_can_be_homed() {
    let mut rig = not_homed();
    rig.drive(|drive| drive.refuses.insert((0x607A, 0), 0x0609_0030));
    home(&mut rig);
    assert!(rig.feedback().homed);
}

#[test]
fn an_error_ends_it_switched_off() {
    let mut rig = not_homed();
    rig.drive(|drive| drive.homing_fails = true);
    home(&mut rig);
    rig.until(AxisPhase::Disabled);
    assert!(!rig.feedback().homed);
    assert!(rig.has_event(failed_with(TransitionError::HomingError)));
    assert_eq!(rig.controlwords().last(), Some(&0x0006));
}

#[test]
fn unconfirmed_homing_start_is_not_repeated() {
    for (disturbance, error) in [
        (Disturbance::LoseReply, TransitionError::Interrupted),
        (Disturbance::FlipReply(7), TransitionError::Unanswered),
    ] {
        let mut rig = not_homed();
        rig.line.state().disturb_write = Some((0x6040, 0x001F, disturbance));
        rig.start_homing();
        rig.until(AxisPhase::Homing);
        rig.until(AxisPhase::Disabled);
        let mut starts = rig.controlwords();
        starts.retain(|word| *word == 0x001F);
        assert_eq!(starts.len(), 1, "{disturbance:?}");
        assert!(rig.has_event(failed_with(error)), "{disturbance:?}");
        assert_eq!(rig.feedback().homings, 1);
    }
}

/// On a line with a gateway no write is repeated after a timeout.
#[test]
fn unconfirmed_current_limit_of_homing_is_restored() {
    let drives = vec![MiniDrive::new(NODE, 11), MiniDrive::new(2, 22)];
    let mut rig = PortRig::with(drives, |port| port.axes[0].homing = HomingMethod::StopPositive);
    rig.until(AxisPhase::Disabled);
    rig.line.state().disturb_write = Some((0x3001, 30, Disturbance::LoseReply));
    rig.start_homing();
    // Its settings are restored, and it answers: it is not lost.
    rig.until_feedback("is off", |axis| {
        assert_ne!(axis.phase, AxisPhase::Lost);
        axis.homings == 1 && axis.phase == AxisPhase::Disabled
    });
    assert!(rig.has_event(failed_with(TransitionError::Interrupted)));
    assert_eq!(rig.drive(|drive| drive.objects[&(0x3001, 2)]), 300);
}

#[test]
fn homing_refused_while_enabled_is_not_executed_later() {
    let mut rig = PortRig::enabled();
    home(&mut rig);
    assert!(rig.has_event(PortEventKind::HomingRefused));
    rig.demand_until(Demand::Disabled, AxisPhase::Disabled);
    rig.turns(100);
    assert!(!rig.controlwords().contains(&0x001F));
}

#[test]
fn quick_stop_interrupts_it() {
    let mut rig = not_homed();
    rig.start_homing();
    rig.until(AxisPhase::Homing);
    rig.turns(8);
    rig.demand_until(Demand::QuickStop, AxisPhase::Disabled);
    assert_eq!(rig.feedback().homings, 1);
    assert!(rig.has_event(failed_with(TransitionError::Interrupted)));
}

#[test]
fn drive_restart_ends_homing_without_start_outside_homing_mode() {
    for turns in 0..50 {
        let mut rig = not_homed();
        rig.start_homing();
        rig.turns(turns);
        rig.line.restart(NODE, Nanos::from_millis(60));
        rig.turns(300);
        assert!(matches!(rig.state(), SWITCH_ON_DISABLED | READY), "after {turns} turns");
        assert_eq!(rig.drive(|drive| drive.starts_outside_homing), 0, "after {turns} turns");
    }
}

#[test]
fn a_homing_mode_without_effect_starts_nothing() {
    let mut rig = not_homed();
    rig.drive(|drive| drive.mode_stuck = true);
    home(&mut rig);
    rig.until(AxisPhase::Disabled);
    let words = rig.controlwords();
    assert!(!words.contains(&0x000F) && !words.contains(&0x001F), "{words:X?}");
}
