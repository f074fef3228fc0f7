use super::*;

#[test]
fn an_enabled_drive_is_left_switched_off() {
    let mut rig = PortRig::enabled();
    rig.shut_down();
    assert_eq!((rig.controlwords(), rig.state()), (vec![0x0007, 0x0006], READY));
    assert_eq!(rig.phase(), AxisPhase::Disabled);
    assert_eq!(rig.kinds().last(), Some(&PortEventKind::Ended { power: DrivePower::Off }));
}

#[test]
fn a_homing_drive_is_left_switched_off_and_starts_no_other_homing() {
    let mut rig = PortRig::disabled();
    rig.start_homing();
    while rig.state() != OPERATION_ENABLED {
        rig.turns(1);
    }
    rig.start_homing();
    rig.shut_down();
    assert!(matches!(rig.state(), READY | SWITCH_ON_DISABLED));
}

#[test]
fn a_silent_line_does_not_block_the_thread() {
    let mut rig = PortRig::enabled();
    rig.line.state().silent = true;
    let begin = rig.line.time();
    rig.shut_down();
    assert!(rig.line.time().since(begin) < Nanos::from_millis(3500));
    assert_eq!(rig.kinds().last(), Some(&PortEventKind::Ended { power: DrivePower::NotKnown }));
}
