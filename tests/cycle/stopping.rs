//! Everything that stops the motion: stale commands, pause, release, disable, old feedback.

use super::*;

/// Ticks until the targets no longer change.
fn ticks_to_rest(bench: &mut Bench) -> usize {
    let mut last_change = 0;
    for tick in 1..=200 {
        let before = bench.targets();
        bench.tick();
        if bench.targets() != before {
            last_change = tick;
        }
    }
    last_change
}

#[test]
fn silent_client_is_followed_until_deadline_plus_two_ticks() {
    let mut bench = Bench::enabled();
    let sent = bench.now + bench.config.control.period();
    assert_eq!(bench.actuator([250, -250]), Refusal::None);
    let (mut last_motion, mut before) = (bench.now, bench.targets());
    while bench.now.duration_since(sent) < Nanos::from_millis(500) {
        bench.tick();
        if bench.targets() != before {
            (last_motion, before) = (bench.now, bench.targets());
        }
    }
    assert!(bench.targets()[0] < 100, "it had not arrived");
    // It was followed as long as it was fresh.
    let followed = last_motion.duration_since(sent);
    let [least, most] = [49, 52].map(Nanos::from_millis);
    assert!((least..most).contains(&followed), "moved {followed:?} after the command");
    assert_eq!(bench.report().stale_stops, 1);
    assert!(bench.report().holding && bench.state() == OperatingState::Enabled);
    let stop = CycleEventKind::StaleStop { client_id: CLIENT, age: Nanos::from_millis(50) };
    assert!(bench.events.contains(&stop), "{:?}", bench.events);
}

/// A deadline beyond the lease would leave a robot that moves without a client.
#[test]
fn no_command_outlives_the_lease() {
    let mut bench = Bench::enabled_with(config("[command]\nlease_timeout_ms = 60"), None);
    let mut command = bench.servo(ServoGoal::Actuator([Counts(250); 2], 2));
    command.deadline = Nanos::from_millis(1000);
    assert_eq!(bench.send(command), Refusal::None);
    bench.run(59);
    assert_eq!((bench.report().holding, bench.report().lease_client_id), (false, CLIENT));
    bench.tick();
    assert_eq!((bench.report().holding, bench.report().lease_client_id), (true, 0));
}

#[test]
fn paused_holds_and_resumes_where_it_is() {
    let mut bench = Bench::moving();
    assert_eq!(bench.ask(StateCommand::Pause), Refusal::None);
    assert_eq!(bench.state(), OperatingState::Paused);
    assert!(ticks_to_rest(&mut bench) <= 1);
    let held = bench.targets();
    assert_eq!(bench.actuator([250, 250]), Refusal::Paused);
    bench.run(2000);
    assert_eq!(bench.targets(), held);
    assert_eq!(bench.phases(), [AxisPhase::Enabled; 2]);
    assert_eq!(bench.ask(StateCommand::Resume), Refusal::None);
    bench.run(100);
    assert_eq!(bench.targets(), held, "nothing moves without a command");
    let far = bench.actuator([held[0] + 300, held[1]]);
    assert_eq!(far, Refusal::StepTooLarge, "a goal that moved away");
    bench.run(100);
    assert_eq!(bench.targets(), held);
    assert_eq!(bench.actuator([held[0] + 10, held[1]]), Refusal::None);
}

#[test]
fn client_that_releases_its_lease_is_not_followed() {
    let mut bench = Bench::moving();
    assert_eq!(bench.ask_as(99, StateCommand::Release).refusal, Refusal::Lease);
    assert!(!bench.report().holding);
    assert_eq!(bench.ask(StateCommand::Release), Refusal::None);
    assert!(bench.report().holding);
    assert_eq!((bench.report().lease_client_id, bench.report().stale_stops), (0, 0));
    assert!(ticks_to_rest(&mut bench) <= 1);
}

#[test]
fn disable_decelerates_and_settles_before_power_off() {
    let mut bench = Bench::moving();
    assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
    assert!(bench.report().busy);
    let begin = bench.now;
    let mut moved = bench.now;
    loop {
        let before = bench.targets();
        bench.tick();
        if bench.out.requests[0].demand != Demand::Enabled {
            break;
        }
        if bench.targets() != before {
            moved = bench.now;
        }
    }
    assert!(moved.duration_since(begin) <= Nanos::from_millis(2));
    assert!(bench.now.duration_since(moved) >= Nanos::from_millis(50));
    bench.idle();
    assert_eq!(bench.phases(), [AxisPhase::Disabled; 2]);
}

/// All drives but the first search for a hard stop.
#[test]
fn every_stop_ends_a_homing() {
    let stops: [fn(&mut Bench); 6] = [
        |bench| assert_eq!(bench.ask(StateCommand::Disable), Refusal::None),
        |bench| assert_eq!(bench.ask_as(CLIENT + 1, StateCommand::Hold).refusal, Refusal::None),
        |bench| assert_eq!(bench.ask(StateCommand::Release), Refusal::None),
        |bench| bench.shutdown = true,
        |bench| bench.drives[0].fail(0x8611),
        // Until the core gives up.
        |bench| bench.run(29_997),
    ];
    for stop in stops {
        let mut bench = Bench::new(with_jaw(config("")), Some(standard_model()));
        (bench.drives[1].delay, bench.jaw.delay) = (60_000, 60_000);
        assert_eq!(bench.ask(StateCommand::Home), Refusal::None);
        bench.run(3);
        stop(&mut bench);
        // A zero that moves until then is not motion.
        let epoch = bench.report().mark.epoch;
        bench.tick();
        assert!(bench.report().mark.epoch > epoch);
        bench.tick();
        let phases = [bench.phases()[1], bench.jaw.feedback.phase];
        assert_eq!(phases, [AxisPhase::Disabling; 2], "{:?}", bench.report());
    }
}

/// A configuration whose stop takes ten seconds: the power is cut after one.
#[test]
fn overlong_stop_ends_with_power_off() {
    let limits = "[limits]\nacceleration_counts_s2 = 200.0\nstop_deceleration_counts_s2 = 200.0";
    let mut bench = Bench::enabled_with(
        config(&format!("{limits}\n[command]\ndeadline_ms = 1000\nlease_timeout_ms = 1000")),
        None,
    );
    for goal in [240, 480, 720, 960] {
        assert_eq!(bench.actuator([goal, goal]), Refusal::None);
        bench.run(400);
    }
    assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
    bench.run(900);
    assert_eq!(bench.phases(), [AxisPhase::Enabled; 2], "it still moves");
    bench.run(200);
    assert_eq!(bench.phases(), [AxisPhase::Disabled; 2]);
}

#[test]
fn old_feedback_stops_motion_until_fresh_feedback_and_command() {
    let mut bench = Bench::moving();
    bench.quirk(1, Quirk::Silent);
    let last_report = bench.drives[1].feedback.stamp;
    while bench.now.duration_since(last_report) < Nanos::from_millis(49) {
        assert_eq!(bench.actuator(bench.targets().map(|target| target + 100)), Refusal::None);
    }
    bench.tick();
    let silent = bench.now.duration_since(last_report);
    assert!(bench.report().holding, "{silent:?} without a position");
    assert_eq!(bench.actuator(bench.targets()), Refusal::DrivesNotReady);
    let held = bench.targets();
    bench.run(80);
    assert_eq!((bench.targets(), bench.state()), (held, OperatingState::Enabled));
    bench.quirk(1, Quirk::None);
    bench.tick();
    assert!(bench.report().holding, "it does not resume automatically");
    assert_eq!(bench.actuator(held), Refusal::None);
}

#[test]
fn an_axis_that_loses_its_zero_stops_the_motion() {
    let mut bench = Bench::moving();
    bench.drives[0].feedback.homed = false;
    bench.tick();
    assert!(bench.report().holding && !bench.report().homed);
    assert_eq!(bench.actuator(bench.targets()), Refusal::NotHomed);
}

#[test]
fn missed_ticks_are_not_made_up_for() {
    let mut bench = Bench::moving();
    bench.skip(Nanos::from_millis(30));
    bench.tick();
    assert!(!bench.report().holding);
    bench.skip(Nanos::from_millis(30));
    bench.tick();
    assert!(bench.report().holding, "the command is 60 ms old by now");
}

/// Positions are read, but setpoints are refused: refused motion is not made up for in one write.
#[test]
fn drive_refusing_setpoints_stops_motion_without_later_jump() {
    let mut bench = Bench::enabled();
    let stream = |bench: &mut Bench, from: i32, ticks: i32| {
        (0..ticks).map(|tick| bench.actuator([from + tick / 10, 0])).collect::<Vec<_>>()
    };
    assert!(stream(&mut bench, 0, 500).iter().all(|it| *it == Refusal::None));
    let written = |bench: &Bench| bench.drives[0].feedback.written.unwrap().target.0;
    bench.quirk(0, Quirk::Deaf);
    let before = written(&bench);
    let answers = stream(&mut bench, 50, 555);
    assert_eq!(bench.report().broken_off, Some(Stop::Setpoint));
    assert!(bench.events.contains(&CycleEventKind::FeedbackStop(Stop::Setpoint)));
    assert_eq!(answers.last(), Some(&Refusal::DrivesNotReady));
    bench.quirk(0, Quirk::None);
    bench.run(20);
    assert!((written(&bench) - before).abs() <= 6, "{before} to {}", written(&bench));
    assert!(bench.report().holding);
}
