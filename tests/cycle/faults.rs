//! FAULT: its causes, the demands to the drives, and the acknowledgement.

use super::reasons::measurement;
use super::*;

fn fault(bench: &Bench) -> Option<Fault> {
    (bench.state() == OperatingState::Fault).then_some(bench.report().fault)
}

fn expect_fault(bench: &mut Bench, expected: Fault) {
    bench.until("FAULT", |bench| bench.state() == OperatingState::Fault);
    assert_eq!(fault(bench), Some(expected));
}

#[test]
fn disable_in_fault_is_an_event_once() {
    let mut bench = Bench::faulted();
    let is_disable = |event: &&CycleEventKind| {
        matches!(event, CycleEventKind::State { command: Some(StateCommand::Disable), .. })
    };
    for _ in 0..3 {
        assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
        bench.run(100);
        assert_eq!(bench.events.iter().filter(is_disable).count(), 1);
    }
}

#[test]
fn drive_error_raises_fault_in_every_state() {
    for build in [Bench::standard, Bench::homed, Bench::enabled, Bench::moving, Bench::paused] {
        let mut bench = build();
        bench.drives[1].fail(0x8611);
        bench.tick();
        assert_eq!(fault(&bench), Some(Fault::Drive));
        let is_reported = bench.events.iter().any(|event| {
            matches!(
                event,
                CycleEventKind::Axis { motor: 1, to: AxisPhase::Faulted, error_code: 0x8611, .. }
            )
        });
        assert!(is_reported, "{:?}", bench.events);
    }
}

#[test]
fn faulted_drive_is_disabled_and_the_other_holds() {
    let mut bench = Bench::moving();
    bench.fault(1);
    assert_eq!(bench.demands(), [Demand::QuickStop, Demand::Disabled]);
    bench.run(100);
    assert_eq!(bench.phases(), [AxisPhase::QuickStopped, AxisPhase::Faulted]);
}

#[test]
fn fault_does_not_power_unpowered_drives() {
    let mut bench = Bench::homed();
    bench.fault(1);
    assert_eq!(bench.demands(), [Demand::Disabled; 2]);
    let mut bench = Bench::homed();
    bench.drives[0].delay = 100;
    bench.ask(StateCommand::Enable);
    bench.run(50);
    bench.fault(0);
    assert_eq!(bench.demands(), [Demand::Disabled; 2], "enabling was in progress");
}

#[test]
fn lost_line_raises_fault_and_keeps_quick_stop_demanded() {
    for build in [Bench::standard, Bench::enabled, Bench::paused] {
        let mut bench = build();
        bench.drives[0].feedback.phase = AxisPhase::Lost;
        bench.tick();
        assert_eq!(fault(&bench), Some(Fault::Link));
    }
    let mut bench = Bench::enabled();
    bench.drives[0].feedback.phase = AxisPhase::Starting;
    bench.tick();
    assert_eq!(fault(&bench), Some(Fault::Link), "it restarts");
    let mut bench = Bench::moving();
    bench.quirk(0, Quirk::Silent);
    bench.drives[0].feedback.phase = AxisPhase::Lost;
    bench.tick();
    assert_eq!(bench.demands(), [Demand::QuickStop; 2]);
    bench.run(10_000);
    // The demand stays, for when the line is back.
    assert_eq!(bench.demands(), [Demand::QuickStop; 2]);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::CausePersists);
    bench.quirk(0, Quirk::None);
    bench.drives[0].feedback.phase = AxisPhase::Enabled;
    bench.run(10);
    assert_eq!(bench.phases()[0], AxisPhase::QuickStopped);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
}

#[test]
fn drive_leaving_enabled_state_raises_fault() {
    use AxisPhase as P;
    for phase in [P::Disabled, P::Enabling, P::Homing, P::QuickStopped, P::Disabling] {
        for build in [Bench::enabled, Bench::paused, Bench::moving] {
            let mut bench = build();
            bench.drives[0].quirk = Quirk::Deaf;
            bench.drives[0].feedback.phase = phase;
            bench.tick();
            assert_eq!(fault(&bench), Some(Fault::DriveState), "{phase:?}");
            // Only a quick stop ends a homing.
            let off = if phase == P::Homing { Demand::QuickStop } else { Demand::Disabled };
            assert_eq!(bench.demands(), [off, Demand::QuickStop], "{phase:?}");
        }
    }
}

#[test]
fn motor_that_does_not_follow_faults_and_loses_power() {
    let mut bench = Bench::enabled();
    bench.quirk(0, Quirk::Blocked);
    for goal in (100..=800).step_by(100) {
        if fault(&bench).is_none() {
            assert_eq!(bench.actuator([goal, 0]), Refusal::None);
        }
        bench.run(45);
    }
    assert_eq!(fault(&bench), Some(Fault::FollowingError));
    let written = bench.drives[0].feedback.written.unwrap().target;
    assert_eq!(written, Counts(301), "the first setpoint beyond 300 counts");
    let error = Measurement::new(Quantity::Counts, 301.0, Some(300.0)).of_motor(0);
    assert_eq!(measurement(&bench, Cause::Fault(Fault::FollowingError)), Some(error));
    bench.quirk(0, Quirk::None);
    bench.run(20);
    assert_eq!(bench.phases(), [AxisPhase::Disabled, AxisPhase::QuickStopped]);
}

/// On a slow line the newest setpoint is far ahead of the one written, which the motor follows.
#[test]
fn queued_setpoint_does_not_count_as_following_error() {
    let mut bench = Bench::enabled_with(config("[limits]\nfollowing_error_counts = 10"), None);
    bench.drives[0].slot = 20;
    assert_eq!(bench.actuator([250, 250]), Refusal::None);
    let mut ahead = 0;
    for _ in 0..20 {
        bench.run(9);
        assert_eq!(bench.actuator([bench.targets()[0].max(200) + 40, 250]), Refusal::None);
        ahead = ahead.max(bench.targets()[0] - bench.drives[0].feedback.position.0);
    }
    assert!(ahead > 20, "{ahead}");
    assert_eq!(fault(&bench), None);
}

#[test]
fn the_gravest_of_two_faults_is_named() {
    let mut bench = Bench::enabled();
    bench.drives[0].feedback.phase = AxisPhase::QuickStopped;
    bench.drives[1].feedback.phase = AxisPhase::Faulted;
    bench.tick();
    assert_eq!(fault(&bench), Some(Fault::Drive));
    assert_eq!(bench.demands(), [Demand::Disabled; 2], "neither is trusted");
}

#[test]
fn a_fault_stays_until_it_is_acknowledged() {
    let mut bench = Bench::faulted();
    bench.drives[0].feedback.phase = AxisPhase::Disabled;
    bench.drives[0].feedback.error_code = 0;
    bench.run(5000);
    assert_eq!(fault(&bench), Some(Fault::Drive));
    assert_eq!(bench.joint(0.0, 0.0), Refusal::InFault);
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::InFault);
}

#[test]
fn an_acknowledge_older_than_the_fault_does_not_end_it() {
    let mut bench = Bench::enabled();
    bench.drives.iter_mut().for_each(|drive| drive.fail(0x8611));
    // It is read in the very tick that enters FAULT, or later.
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::InFault);
    bench.run(10);
    bench.request_age = Nanos::from_millis(11);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::InFault);
    assert_eq!(fault(&bench), Some(Fault::Drive));
    bench.request_age = Nanos::from_millis(10);
    bench.carry_out(StateCommand::Acknowledge);
    assert_eq!(bench.state(), OperatingState::Disabled);
}

#[test]
fn drive_restart_during_reset_leaves_fault_acknowledgeable() {
    let mut bench = Bench::enabled();
    bench.drives[0].feedback.phase = AxisPhase::Faulted;
    bench.run(5);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
    bench.drives[0].feedback.phase = AxisPhase::Starting;
    bench.drives[1].feedback.phase = AxisPhase::Faulted;
    // Longer than the reset may take.
    bench.run(1500);
    assert_eq!(bench.state(), OperatingState::Fault);
    bench.drives[0].feedback.phase = AxisPhase::Disabled;
    bench.run(5);
    bench.carry_out(StateCommand::Acknowledge);
    assert_eq!(bench.state(), OperatingState::Disabled);
}

#[test]
fn acknowledge_resets_only_the_faulted_drive_without_motion() {
    let mut bench = Bench::faulted();
    assert_eq!(bench.out.requests.map(|request| request.fault_resets), [0, 0]);
    let before = bench.drives.map(|drive| drive.feedback.position);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
    assert_eq!(bench.out.requests.map(|request| request.fault_resets), [1, 0]);
    assert_eq!((bench.state(), bench.report().busy), (OperatingState::Fault, true));
    bench.idle();
    assert_eq!((bench.state(), bench.report().fault), (OperatingState::Disabled, Fault::Drive));
    assert_eq!(bench.phases(), [AxisPhase::Disabled; 2]);
    assert_eq!(bench.drives.map(|drive| drive.feedback.position), before);
    bench.enable();
    bench.run(500);
    assert_eq!(bench.drives.map(|drive| drive.feedback.position), before);
    assert_eq!(bench.joints().goal, bench.joints().setpoint);
}

#[test]
fn a_fault_that_cannot_be_reset_stays() {
    let mut bench = Bench::faulted();
    bench.quirk(0, Quirk::Broken);
    bench.carry_out(StateCommand::Acknowledge);
    assert_eq!(fault(&bench), Some(Fault::Drive));
    bench.quirk(0, Quirk::None);
    bench.carry_out(StateCommand::Acknowledge);
    assert_eq!(bench.state(), OperatingState::Disabled);
    assert_eq!(bench.out.requests[0].fault_resets, 2);
}

#[test]
fn drive_that_misses_its_quick_stop_is_switched_off() {
    let mut bench = Bench::enabled();
    bench.quirk(1, Quirk::Deaf);
    bench.fault(0);
    assert_eq!(bench.demands(), [Demand::Disabled, Demand::QuickStop]);
    // A drive is where it should not be.
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::CausePersists);
    bench.run(3000);
    assert_eq!(bench.demands(), [Demand::Disabled; 2]);
}

#[test]
fn disabled_drive_is_not_asked_to_hold_later() {
    let mut bench = Bench::faulted();
    bench.run(10);
    assert_eq!(bench.phases()[1], AxisPhase::QuickStopped);
    bench.drives[1].feedback.phase = AxisPhase::Disabled;
    bench.run(10);
    assert_eq!(bench.demands(), [Demand::Disabled; 2]);
}

#[test]
fn drive_that_does_not_disable_raises_fault() {
    let mut bench = Bench::enabled();
    bench.quirk(0, Quirk::Deaf);
    assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
    expect_fault(&mut bench, Fault::DriveTimeout);
    assert_eq!(bench.demands(), [Demand::Disabled; 2]);
}

#[test]
fn fault_persists_while_drive_is_silent() {
    let mut bench = Bench::enabled();
    bench.quirk(1, Quirk::Silent);
    expect_fault(&mut bench, Fault::Link);
    bench.drives[1].feedback.phase = AxisPhase::QuickStopped;
    bench.run(10);
    // Its last report is old.
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::CausePersists);
    bench.quirk(1, Quirk::None);
    bench.run(10);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
}
