use super::*;

#[test]
fn an_enabled_drive_is_left_switched_off() {
    let mut rig = Rig::enabled();
    rig.shut_down();
    assert_eq!(
        (rig.controlwords(), rig.drive(|drive| drive.state)),
        (vec![0x0007, 0x0006], READY)
    );
    assert_eq!(rig.feedback().phase, AxisPhase::Disabled);
    assert_eq!(
        rig.kinds().last(),
        Some(&PortEventKind::Ended { off: true })
    );
}

#[test]
fn a_homing_drive_is_left_switched_off_and_starts_no_other() {
    let mut rig = Rig::disabled();
    rig.request(|request| request.homings += 1);
    while rig.drive(|drive| drive.state) != OPERATION_ENABLED {
        rig.turns(1);
    }
    rig.request(|request| request.homings += 1);
    rig.shut_down();
    assert!(matches!(
        rig.drive(|drive| drive.state),
        READY | SWITCH_ON_DISABLED
    ));
}

#[test]
fn a_dead_line_does_not_keep_the_thread() {
    let mut rig = Rig::enabled();
    rig.bench.world().dead = true;
    let begin = rig.bench.time();
    rig.shut_down();
    assert!(rig.bench.time().since(begin) < Nanos::from_millis(3500));
    assert_eq!(
        rig.kinds().last(),
        Some(&PortEventKind::Ended { off: false })
    );
}
