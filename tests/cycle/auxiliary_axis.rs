//! The auxiliary axis: a third drive that stops with the others and moves without them.

use i2ris::units::MAX_MOTORS;

use super::*;

type Change = fn(&mut ServoCommand);

fn enabled() -> Bench {
    Bench::enabled_with(with_jaw(config("")), Some(standard_model()))
}

fn angle(bench: &mut Bench, degrees: f64) -> ServoCommand {
    bench.servo(ServoGoal::Joint([degrees.to_radians(), 0.0, 0.0], 1))
}

fn jaw_target(bench: &Bench) -> Counts {
    bench.out.auxiliary.unwrap().target
}

#[test]
fn jaw_follows_its_own_stream() {
    let mut bench = enabled();
    for k in 1..=200 {
        let share = f64::from(k) / 200.0;
        let jaw = angle(&mut bench, 20.0 * share);
        assert_eq!(bench.send_jaw(jaw), Refusal::None);
        assert_eq!(bench.joint(4.0 * share, -2.0 * share), Refusal::None);
        bench.run(3);
    }
    bench.run(30);
    assert!((jaw_target(&bench).0 + 200).abs() <= 2, "{:?}", jaw_target(&bench));
    let report = bench.report().auxiliary.unwrap();
    assert!((report.measured.to_degrees() - 20.0).abs() < 0.3, "{report:?}");
    let [pitch, yaw, _] = bench.joints().setpoint.map(f64::to_degrees);
    assert!((pitch - 4.0).abs() < 0.1 && (yaw + 2.0).abs() < 0.1, "{pitch} {yaw}");
    // The jaw and a trajectory of the joints do not wait for each other.
    bench.run(100);
    assert_eq!(bench.go(0.0, 0.0), Refusal::None);
    let jaw = angle(&mut bench, 21.0);
    assert_eq!(bench.send_jaw(jaw), Refusal::None);
    bench.run(20);
    assert!((jaw_target(&bench).0 + 210).abs() <= 1);
    bench.idle();
}

#[test]
fn jaw_holds_without_commands_and_when_robot_holds() {
    for stop in [None, Some(StateCommand::Hold), Some(StateCommand::Pause)] {
        let slow = with_jaw(config("[limits]\nstop_deceleration_counts_s2 = 40000.0"));
        let mut bench = Bench::enabled_with(slow, Some(standard_model()));
        for k in 1..=20 {
            let jaw = angle(&mut bench, f64::from(k));
            assert_eq!(bench.send_jaw(jaw), Refusal::None);
            bench.run(4);
        }
        match stop {
            None => {
                bench.run(160);
                let stale = |it: &CycleEventKind| matches!(it, CycleEventKind::StaleStop { .. });
                assert!(bench.events.iter().any(stale));
            }
            Some(command) => {
                assert_eq!(bench.ask_as(CLIENT + 1, command).refusal, Refusal::None);
                let from = jaw_target(&bench);
                bench.run(100);
                assert!((jaw_target(&bench).0 - from.0).abs() > 10, "it slows down");
            }
        }
        let before = jaw_target(&bench);
        bench.run(500);
        assert_eq!(jaw_target(&bench), before);
    }
}

#[test]
fn jaw_commands_pass_the_common_checks() {
    let mut bench = enabled();
    let whole = |it: &mut ServoCommand| it.goal = ServoGoal::Joint([0.0; 3], 2);
    let changes: [(Change, Refusal); 6] = [
        (|it| it.goal = ServoGoal::Joint([f64::NAN, 0.0, 0.0], 1), Refusal::NotFinite),
        (whole, Refusal::Malformed),
        (|it| it.clutched = true, Refusal::Malformed),
        (|it| it.has_unknown_flags = true, Refusal::Malformed),
        (|it| it.goal = ServoGoal::Joint([2.0, 0.0, 0.0], 1), Refusal::Range),
        (|it| it.goal = ServoGoal::Joint([0.6, 0.0, 0.0], 1), Refusal::StepTooLarge),
    ];
    let before = jaw_target(&bench);
    for (change, expected) in changes {
        let mut command = angle(&mut bench, 0.0);
        change(&mut command);
        assert_eq!(bench.send_jaw(command), expected, "{command:?}");
    }
    assert_eq!(jaw_target(&bench), before);
    let mut other = angle(&mut bench, 1.0);
    assert_eq!(bench.joint(0.1, 0.0), Refusal::None);
    (other.client_id, other.stamp) = (CLIENT + 1, bench.now);
    assert_eq!(bench.send_jaw(other), Refusal::Lease);
    // It has its own sequence numbers, so it may overtake the other stream.
    let (late, next) = (angle(&mut bench, 1.0), bench.servo(ServoGoal::Joint([0.0; 3], 2)));
    assert_eq!(bench.send(next), Refusal::None);
    assert_eq!(bench.send_jaw(late), Refusal::None);
    assert_eq!(bench.send_jaw(late), Refusal::Sequence);
    // A robot without one.
    let mut bench = Bench::enabled();
    let command = angle(&mut bench, 1.0);
    assert_eq!(bench.send_jaw(command), Refusal::Unsupported);
    assert_eq!(bench.out.auxiliary, None);
}

#[test]
fn a_fault_of_any_axis_stops_all() {
    let demands = |bench: &Bench| {
        let [first, second] = bench.out.requests.map(|request| request.demand);
        [first, second, bench.out.auxiliary.unwrap().demand]
    };
    for axis in 0..=MAX_MOTORS {
        let mut bench = enabled();
        let drive = if axis < MAX_MOTORS { &mut bench.drives[axis] } else { &mut bench.jaw };
        drive.fail(0x2310);
        bench.run(3);
        assert_eq!((bench.state(), bench.report().fault), (OperatingState::Fault, Fault::Drive));
        let mut expected = [Demand::QuickStop; 3];
        expected[axis] = Demand::Disabled;
        assert_eq!(demands(&bench), expected);
        let reason = bench.reasons.iter().find_map(|reason| reason.measurement);
        assert_eq!(reason.unwrap().motor, Some(axis as u8));
        bench.run(50);
        bench.carry_out(StateCommand::Acknowledge);
        assert_eq!(bench.state(), OperatingState::Disabled);
    }
    let mut bench = enabled();
    bench.jaw.quirk = Quirk::Silent;
    bench.until("a fault", |bench| bench.state() == OperatingState::Fault);
    assert_eq!(bench.report().fault, Fault::Link);
}

#[test]
fn robot_is_homed_and_enabled_only_with_jaw() {
    let mut bench = Bench::new(with_jaw(config("")), Some(standard_model()));
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::NotHomed);
    bench.home();
    bench.jaw.feedback.position = Counts(1001);
    let reply = bench.ask_as(CLIENT, StateCommand::Enable);
    let outside = Measurement::new(Quantity::Counts, 1001.0, Some(1000.0)).of_motor(2);
    assert_eq!((reply.refusal, reply.measurement), (Refusal::Range, Some(outside)));
    bench.jaw.feedback.position = Counts(0);
    assert!(bench.jaw.feedback.homed);
    bench.jaw.feedback.homed = false;
    bench.tick();
    assert!(!bench.report().homed);
    bench.jaw.feedback.homed = true;
    bench.enable();
    assert_eq!(bench.jaw.feedback.phase, AxisPhase::Enabled);
    bench.carry_out(StateCommand::Disable);
    assert_eq!(bench.jaw.feedback.phase, AxisPhase::Disabled);
}
