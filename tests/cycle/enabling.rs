//! DISABLED: homing and enabling.

use super::*;

#[test]
fn drives_that_are_not_ready_cannot_be_enabled_or_homed() {
    use AxisPhase as P;
    for phase in [P::Starting, P::Enabling, P::Enabled, P::Homing, P::QuickStopped, P::Disabling] {
        for command in [StateCommand::Enable, StateCommand::Home] {
            let mut bench = Bench::homed();
            bench.quirk(1, Quirk::Deaf);
            bench.drives[1].feedback.phase = phase;
            let refusal = bench.ask(command);
            assert!(
                // An enabled drive is disabled first, and `enable` waits for it.
                matches!(refusal, Refusal::DrivesNotReady | Refusal::Busy)
                    || command == StateCommand::Enable && bench.report().busy,
                "{command} with {phase:?}: {refusal}"
            );
            assert_eq!(bench.out.requests[0].demand, Demand::Disabled);
        }
    }
}

#[test]
fn a_drive_that_was_left_on_is_switched_off_first() {
    let mut bench = Bench::standard();
    bench.drives[0].feedback.phase = AxisPhase::Enabled;
    bench.tick();
    assert!(bench.report().busy);
    bench.idle();
    assert_eq!(bench.phases()[0], AxisPhase::Disabled);
}

#[test]
fn invalidated_zero_returns_only_by_homing() {
    let mut bench = Bench::homed();
    assert_eq!(bench.ask(StateCommand::Unhome), Refusal::None);
    bench.run(100);
    assert!(!bench.report().homed, "the drive still reports homed");
    let invalid = |bench: &Bench| bench.out.requests.map(|request| request.zero_invalid);
    assert_eq!(invalid(&bench), [true; 2], "no position is saved");
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::NotHomed);
    bench.home();
    bench.run(1);
    assert_eq!(invalid(&bench), [false; 2]);
    bench.enable();
}

#[test]
fn homing_raises_the_counter_of_every_drive_once() {
    let mut bench = Bench::standard();
    bench.home();
    bench.run(100);
    assert_eq!(bench.out.requests.map(|request| request.homings), [1, 1]);
    bench.home();
    assert_eq!(bench.out.requests.map(|request| request.homings), [2, 2]);
}

#[test]
fn homing_without_resulting_zero_raises_fault() {
    let mut bench = Bench::standard();
    bench.quirk(1, Quirk::Homeless);
    assert_eq!(bench.ask(StateCommand::Home), Refusal::None);
    bench.until("FAULT", |bench| bench.state() == OperatingState::Fault);
    assert_eq!(bench.report().fault, Fault::Homing);
    assert_eq!(bench.demands(), [Demand::Disabled; 2]);
    bench.carry_out(StateCommand::Acknowledge);
    bench.quirk(1, Quirk::None);
    bench.home();
}

#[test]
fn a_motor_outside_its_limits_cannot_be_enabled() {
    let mut bench = Bench::homed();
    bench.drives[0].feedback.position = Counts(1001);
    let reply = bench.ask_as(CLIENT, StateCommand::Enable);
    let outside = Measurement::new(Quantity::Counts, 1001.0, Some(1000.0)).of_motor(0);
    assert_eq!((reply.refusal, reply.measurement), (Refusal::Range, Some(outside)));
    bench.drives[0].feedback.position = Counts(1000);
    bench.drives[1].feedback.position = Counts(-701);
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::Range);
    bench.drives[1].feedback.position = Counts(-700);
    bench.enable();
    assert_eq!(bench.targets(), [1000, -700]);
}

#[test]
fn target_follows_position_until_drive_is_enabled() {
    let mut bench = Bench::homed();
    bench.drives[1].delay = 40;
    bench.ask(StateCommand::Enable);
    for position in [5, 17, -3] {
        bench.drives[1].feedback.position = Counts(position);
        bench.tick();
        assert_eq!(bench.phases()[1], AxisPhase::Enabling);
        assert_eq!(bench.targets()[1], position);
    }
    bench.until("ENABLED", |bench| bench.state() == OperatingState::Enabled);
}

/// The drive holds the preloaded target, which may be some counts away from where the motor is.
#[test]
fn the_setpoint_starts_where_the_drive_holds() {
    let mut bench = Bench::homed();
    bench.drives[1].feedback.position = Counts(40);
    bench.quirk(1, Quirk::Blocked);
    bench.ask(StateCommand::Enable);
    bench.until("preload", |bench| bench.phases()[1] == AxisPhase::Enabling);
    assert_eq!(bench.drives[1].feedback.written.unwrap().target, Counts(40));
    bench.drives[1].feedback.position = Counts(37);
    bench.until("ENABLED", |bench| bench.state() == OperatingState::Enabled);
    bench.run(20);
    assert_eq!(bench.targets()[1], 40);
}

#[test]
fn re_enabled_drive_holds_its_position_not_its_old_target() {
    let mut bench = Bench::enabled();
    assert_eq!(bench.actuator([200, 0]), Refusal::None);
    bench.run(40);
    assert!(bench.targets()[0] > 10);
    bench.ask(StateCommand::Disable);
    bench.idle();
    bench.quirk(0, Quirk::SilentPreload);
    bench.drives[0].slot = 100;
    bench.drives[0].feedback.position = Counts(-600);
    bench.enable();
    bench.run(20);
    assert_eq!(bench.targets()[0], -600, "not the target of the previous session");
    assert_eq!(bench.state(), OperatingState::Enabled, "nor is it a following error");
}

#[test]
fn enabled_is_reported_only_when_every_drive_is() {
    let mut bench = Bench::homed();
    bench.drives[1].delay = 200;
    bench.ask(StateCommand::Enable);
    bench.run(100);
    assert_eq!(bench.phases(), [AxisPhase::Enabled, AxisPhase::Enabling]);
    assert_eq!((bench.state(), bench.report().busy), (OperatingState::Disabled, true));
    assert_eq!(bench.joint(0.0, 0.0), Refusal::NotEnabled);
    bench.until("ENABLED", |bench| bench.state() == OperatingState::Enabled);
    assert_eq!(bench.phases(), [AxisPhase::Enabled; 2]);
    let enabled = CycleEventKind::State {
        from: OperatingState::Disabled,
        to: OperatingState::Enabled,
        command: Some(StateCommand::Enable),
        fault: Fault::None,
    };
    assert!(bench.events.contains(&enabled), "{:?}", bench.events);
}

#[test]
fn drive_that_fails_to_enable_disables_all_drives() {
    let mut bench = Bench::homed();
    bench.quirk(1, Quirk::Deaf);
    let begin = bench.now;
    bench.ask(StateCommand::Enable);
    bench.until("FAULT", |bench| bench.state() == OperatingState::Fault);
    assert_eq!(bench.report().fault, Fault::DriveTimeout);
    assert!(bench.now.duration_since(begin) <= Nanos::from_millis(3010));
    assert_eq!(bench.demands(), [Demand::Disabled; 2]);
    bench.run(20);
    assert_eq!(bench.phases(), [AxisPhase::Disabled; 2]);
}

#[test]
fn first_report_of_slow_drive_is_awaited() {
    let mut bench = Bench::new(config(""), None);
    bench.drives.iter_mut().for_each(|drive| {
        drive.quirk = Quirk::Silent;
        drive.feedback.stamp = Nanos::ZERO;
        drive.feedback.phase = AxisPhase::Starting;
    });
    bench.run(2000);
    assert_eq!((bench.state(), bench.report().fault), (OperatingState::Disabled, Fault::None));
    assert_eq!(bench.ask_as(CLIENT, StateCommand::Home).refusal, Refusal::DrivesNotReady);
}

/// A drive that reports off may not have received the demand to switch on yet.
#[test]
fn report_older_than_the_demand_is_ignored() {
    let mut bench = Bench::homed();
    bench.drives.iter_mut().for_each(|drive| drive.quirk = Quirk::Deaf);
    bench.ask(StateCommand::Enable);
    assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
    bench.run(49);
    assert!(bench.report().busy);
    bench.tick();
    assert!(!bench.report().busy);
}

#[test]
fn homing_is_over_when_the_drive_is_off_again() {
    let mut bench = Bench::standard();
    bench.quirk(0, Quirk::Deaf);
    bench.drives[0].feedback.homed = true;
    assert_eq!(bench.ask(StateCommand::Home), Refusal::None);
    bench.drives[0].feedback.phase = AxisPhase::Homing;
    bench.drives[0].feedback.homings = 1;
    for _ in 0..50 {
        bench.tick();
        assert!(bench.report().busy);
    }
    bench.drives[0].feedback.phase = AxisPhase::Disabled;
    bench.tick();
    assert!(!bench.report().busy && bench.report().homed);
}

#[test]
fn enable_during_disabling_waits_until_drives_are_off() {
    for ticks in [0, 5, 30, 60, 75] {
        let mut bench = Bench::moving();
        assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
        bench.run(ticks);
        assert_eq!(bench.ask(StateCommand::Enable), Refusal::None, "{ticks} ticks");
        assert!(bench.report().busy && bench.state() == OperatingState::Disabled);
        let mut was_off = false;
        while bench.state() != OperatingState::Enabled {
            was_off |= bench.phases() == [AxisPhase::Disabled; 2];
            bench.tick();
            assert!(bench.report().busy || bench.state() == OperatingState::Enabled);
        }
        assert!(was_off, "the drives have been off in between");
    }
}

#[test]
fn pending_enable_is_cancelled_by_disable_or_lost_zero() {
    let mut bench = Bench::moving();
    assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::None);
    bench.carry_out(StateCommand::Disable);
    assert_eq!(bench.state(), OperatingState::Disabled);
    assert_eq!(bench.phases(), [AxisPhase::Disabled; 2]);
    bench.enable();
    assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
    bench.drives[0].feedback.homed = false;
    bench.tick();
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::NotHomed);
    bench.idle();
    assert_eq!(bench.state(), OperatingState::Disabled);
}
