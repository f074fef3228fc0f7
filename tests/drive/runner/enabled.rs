use super::*;

#[test]
fn only_the_newest_target_is_written() {
    let mut rig = PortRig::enabled();
    for target in 0..600 {
        rig.request(|request| request.target = Counts(target));
        if target % 3 == 2 {
            rig.turns(1);
        }
    }
    let written = rig.drive(|drive| drive.written(0x607A, 0));
    assert!(written.len() > 80, "{}", written.len());
    assert!(written.iter().all(|target| target % 3 == 2), "{written:?}");
    assert!(written.is_sorted(), "never back to an older target");
}

#[test]
fn the_written_target_is_reported_with_its_request() {
    let mut rig = PortRig::enabled();
    rig.request(|request| {
        request.target = Counts(130);
        request.command_stamp = Nanos(77);
        request.command_sequence = 9;
    });
    let sequence = rig.newest(0).sequence;
    rig.turns(4);
    let (now, newest) = (rig.line.time(), rig.newest(0).sequence);
    let written = rig.feedback().written.unwrap();
    assert_eq!(written.target, Counts(130));
    assert!((sequence..=newest).contains(&written.sequence), "{written:?}");
    assert_eq!((written.command_stamp, written.command_sequence), (Nanos(77), 9));
    assert!(written.stamp <= now && now.duration_since(written.stamp) < Nanos::from_millis(20));
    assert_eq!(rig.feedback().position, Counts(130));
}

#[test]
fn setpoint_of_new_command_is_the_next_exchange() {
    let mut rig = PortRig::enabled();
    for step in 1..200 {
        // Every phase of the rounds, with and without a monitored value.
        rig.turns(2 + step as usize % 9);
        let target = Counts(120 + step);
        rig.request(|request| {
            request.target = target;
            request.command_sequence += 1;
        });
        rig.turns(1);
        assert_eq!(rig.feedback().written.unwrap().target, target, "{step}");
    }
}

#[test]
fn target_outside_limits_is_reported_once_and_not_written() {
    let mut rig = PortRig::enabled();
    let refusals = |rig: &PortRig| {
        rig.count_events(|kind| matches!(kind, PortEventKind::TargetRefused { .. }))
    };
    rig.request(|request| request.target = Counts(2001));
    rig.turns(50);
    assert!(rig.drive(|drive| drive.written(0x607A, 0)).iter().all(|target| *target == 120));
    assert_eq!(refusals(&rig), 1);
    let sequence = rig.feedback().sequence;
    rig.turns(20);
    assert!(rig.feedback().sequence > sequence, "positions are still read");

    // Up to the maximum following error.
    let far = i2ris_testing::fast_axis(0, 0, [Counts(0); 2]).following_error_counts as i32;
    let mut refused = 1;
    for at in (120 + far..2000).step_by(far as usize).chain([2000]) {
        rig.request(|request| request.target = Counts(at));
        rig.turns(5);
        assert_eq!(rig.feedback().written.unwrap().target, Counts(at));
        rig.request(|request| request.target = Counts(at + far + 1));
        rig.turns(50);
        refused += 1;
        assert_eq!(refusals(&rig), refused);
    }
    rig.request(|request| request.target = Counts(1999));
    rig.turns(5);
    rig.request(|request| request.target = Counts(-2001));
    rig.turns(50);
    assert_eq!(refusals(&rig), refused + 1);
    assert_eq!(rig.drive(|drive| drive.position), 1999);
}

#[test]
fn the_line_is_never_idle() {
    let mut rig = PortRig::enabled();
    let (begin, before) = (rig.line.time(), rig.feedback().counters.exchanges);
    rig.turns(1000);
    let exchanges = rig.feedback().counters.exchanges - before;
    let span = rig.line.time().duration_since(begin).as_seconds();
    // 24 bytes of ten bits at 115200 baud, and 0.3 ms of processing.
    let possible = span / (24.0 * 10.0 / 115_200.0 + 0.3e-3);
    assert!(exchanges as f64 > 0.99 * possible, "{exchanges} of {possible:.0}");
    assert_eq!(rig.line.state().pipelined, 0, "no request before the reply");
}

#[test]
fn drive_that_fails_to_switch_off_cleanly_loses_power() {
    let mut rig = PortRig::enabled();
    rig.drive(|drive| drive.stuck = true);
    rig.demand(Demand::Disabled);
    rig.turns(3000);
    assert!(rig.controlwords().contains(&0x0000), "{:?}", rig.controlwords());
    assert!(rig.count_events(|kind| matches!(kind, PortEventKind::StillPowered(_))) > 0);
    assert_eq!(rig.phase(), AxisPhase::Disabling);
    rig.drive(|drive| drive.stuck = false);
    rig.until(AxisPhase::Disabled);
}

#[test]
fn drive_that_switches_itself_off_stays_off() {
    let mut rig = PortRig::enabled();
    rig.drive(|drive| drive.state = SWITCH_ON_DISABLED);
    rig.until(AxisPhase::Disabled);
    assert!(rig.count_events(|kind| matches!(kind, PortEventKind::UnexpectedState(_))) > 0);
    rig.turns(100);
    assert_eq!(rig.phase(), AxisPhase::Disabled);
    rig.release_and_enable();
}

#[test]
fn lost_target_is_replaced_by_newest_not_repeated() {
    let mut rig = PortRig::enabled();
    rig.turns(40);
    for target in (200..1000).step_by(2) {
        rig.line.state().disturb_write = Some((0x607A, target, Disturbance::LoseRequest));
        rig.request(|request| request.target = Counts(target as i32));
        while rig.line.state().disturb_write.is_some() {
            rig.turns(1);
        }
        rig.request(|request| request.target = Counts(target as i32 + 1));
        rig.turns(4);
    }
    let written = rig.drive(|drive| drive.written(0x607A, 0));
    let is_newest = |target: &u32| *target == 120 || target % 2 == 1;
    assert!(written.iter().all(is_newest), "{written:?}");
    assert_eq!((rig.phase(), rig.feedback().counters.timeouts), (AxisPhase::Enabled, 400));
    assert!(rig.count_events(|kind| matches!(kind, PortEventKind::TimedOut(_))) > 0);
}
