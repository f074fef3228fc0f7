//! Command admission: which servo commands are refused, in which order, and who may command.

use super::*;

const HERE: ServoGoal = ServoGoal::Joint([0.0; 3], 2);

fn counts(motors: [i32; 2]) -> ServoGoal {
    ServoGoal::Actuator(motors.map(Counts), 2)
}

/// A command that would be accepted, changed.
fn refusal(bench: &mut Bench, change: impl FnOnce(&mut ServoCommand)) -> Refusal {
    let mut command = bench.servo(HERE);
    change(&mut command);
    let (before, joint) = (bench.out, bench.joints().setpoint);
    let refusal = bench.send(command);
    if refusal != Refusal::None {
        let lease = bench.report().lease_client_id;
        assert!(lease == before.report.lease_client_id || lease == 0, "a refusal gives no lease");
        assert_eq!(bench.joints().setpoint, joint, "a refusal moves nothing");
    }
    refusal
}

#[test]
fn a_command_of_the_wrong_shape_is_malformed() {
    let mut bench = Bench::enabled();
    for entries in [0, 1, 3, 4, u32::MAX] {
        for goal in
            [ServoGoal::Joint([0.0; 3], entries), ServoGoal::Actuator([Counts(0); 2], entries)]
        {
            assert_eq!(refusal(&mut bench, |c| c.goal = goal), Refusal::Malformed, "{goal:?}");
        }
    }
    assert_eq!(refusal(&mut bench, |c| c.client_id = 0), Refusal::Malformed);
    assert_eq!(refusal(&mut bench, |c| c.has_unknown_flags = true), Refusal::Malformed);
}

#[test]
fn refusals_are_counted_client_by_client() {
    let mut bench = Bench::enabled();
    let other = CLIENT + 1;
    for client_id in [other, CLIENT, other] {
        let goal = ServoGoal::Joint([f64::NAN; 3], 2);
        refusal(&mut bench, |c| (c.client_id, c.goal) = (client_id, goal));
    }
    let refusals = bench.report().refusals;
    let counts = [CLIENT, other].map(|client_id| {
        let mut entries = refusals.iter().filter(|entry| entry.count > 0);
        entries.find(|entry| entry.client_id == client_id).map(|entry| entry.count)
    });
    assert_eq!(counts, [Some(1), Some(2)]);
}

#[test]
fn non_finite_values_are_refused_and_unsent_values_ignored() {
    let mut bench = Bench::enabled();
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let goal = ServoGoal::Joint([0.0, value, 0.0], 2);
        assert_eq!(refusal(&mut bench, |c| c.goal = goal), Refusal::NotFinite);
    }
    let unsent = ServoGoal::Joint([0.0, 0.0, f64::NAN], 2);
    assert_eq!(refusal(&mut bench, |c| c.goal = unsent), Refusal::None);
    bench.run(10);
    assert_eq!(bench.joints().goal, [0.0; 3]);
}

#[test]
fn sequences_rise_per_client_even_after_the_lease_is_gone() {
    // Its motors stop at once, so that silence interrupts nothing.
    let mut bench = Bench::enabled_with(config(""), Some(model(OutputUnit::Deg)));
    assert_eq!(refusal(&mut bench, |c| c.sequence = 500), Refusal::None);
    assert_eq!(refusal(&mut bench, |c| c.sequence = 500), Refusal::Sequence);
    assert_eq!(refusal(&mut bench, |c| c.sequence = 499), Refusal::Sequence);
    bench.run(600);
    assert_eq!(bench.report().lease_client_id, 0);
    assert_eq!(refusal(&mut bench, |c| c.sequence = 500), Refusal::Sequence, "a replay");
    assert_eq!(refusal(&mut bench, |c| (c.client_id, c.sequence) = (8, 1)), Refusal::None);
    assert_eq!(refusal(&mut bench, |c| (c.client_id, c.sequence) = (8, 1)), Refusal::Sequence);
    assert_eq!(bench.ask_as(8, StateCommand::Release).refusal, Refusal::None);
    // A command that the network held back while another client commanded.
    assert_eq!(refusal(&mut bench, |c| c.sequence = 499), Refusal::Sequence);
    assert_eq!(refusal(&mut bench, |c| c.sequence = 501), Refusal::None);
}

#[test]
fn a_refused_command_uses_up_no_sequence_number() {
    let mut bench = Bench::enabled();
    let far = ServoGoal::Joint(rad(20.0, 0.0), 2);
    assert_eq!(refusal(&mut bench, |c| (c.sequence, c.goal) = (900, far)), Refusal::StepTooLarge);
    assert_eq!(refusal(&mut bench, |c| c.sequence = 900), Refusal::None);
}

#[test]
fn one_client_commands_at_a_time() {
    let mut bench = Bench::enabled();
    assert_eq!(refusal(&mut bench, |_| {}), Refusal::None);
    assert_eq!(bench.report().lease_client_id, CLIENT);
    for _ in 0..10 {
        bench.run(100);
        assert_eq!(refusal(&mut bench, |c| c.client_id = 8), Refusal::Lease);
        assert_eq!(refusal(&mut bench, |_| {}), Refusal::None, "which renews the lease");
    }
    bench.run(499);
    assert_eq!(refusal(&mut bench, |c| c.client_id = 8), Refusal::None, "500 ms of silence");
    assert_eq!(bench.report().lease_client_id, 8);
    let lease = |event: &CycleEventKind| match event {
        CycleEventKind::Lease { client_id } => Some(*client_id),
        _ => None,
    };
    assert_eq!(bench.events.iter().filter_map(lease).collect::<Vec<_>>(), [CLIENT, 0, 8]);
}

#[test]
fn refused_commands_do_not_renew_the_lease() {
    let Some(_) = lag_counts() else { return };
    let mut bench = Bench::enabled();
    assert_eq!(refusal(&mut bench, |_| {}), Refusal::None);
    for _ in 0..50 {
        bench.run(9);
        let _ = refusal(&mut bench, |c| c.goal = ServoGoal::Joint([f64::NAN; 3], 2));
    }
    assert_eq!(bench.report().lease_client_id, 0);
}

#[test]
fn counts_outside_the_position_limits_are_refused() {
    let mut bench = Bench::enabled();
    for motors in [[1001, 0], [0, 1001], [-1001, 0], [0, -701], [i32::MIN, i32::MAX]] {
        assert_eq!(refusal(&mut bench, |c| c.goal = counts(motors)), Refusal::Range, "{motors:?}");
    }
}

#[test]
fn first_step_is_measured_from_present_setpoint() {
    let Some(_) = lag_counts() else { return };
    let mut bench = Bench::enabled();
    assert_eq!(bench.joint(5.01, 0.0), Refusal::StepTooLarge);
    assert_eq!(bench.joint(3.6, 3.6), Refusal::StepTooLarge, "the length of the step: 5.09 deg");
    assert_eq!(bench.joint(5.0, 0.0), Refusal::None);
    let mut bench = Bench::enabled();
    assert_eq!(bench.actuator([251, 0]), Refusal::StepTooLarge);
    assert_eq!(bench.actuator([250, -250]), Refusal::None);
}

#[test]
fn next_step_is_measured_from_previous_goal() {
    let mut bench = Bench::enabled();
    assert_eq!(bench.joint(5.0, 0.0), Refusal::None);
    assert_eq!(bench.joint(10.1, 0.0), Refusal::StepTooLarge);
    assert_eq!(bench.joint(9.9, 0.0), Refusal::None);
    assert_eq!(bench.joint(4.8, 0.0), Refusal::StepTooLarge);
    // A different kind of goal starts again from the setpoints.
    assert_eq!(bench.actuator([250, 250]), Refusal::None);
    assert_eq!(bench.actuator([500, 500]), Refusal::None);
    assert_eq!(bench.joint(4.9, 0.0), Refusal::None);
}

#[test]
fn the_first_failed_check_names_the_refusal() {
    let bad = |bench: &mut Bench| {
        let mut command = bench.servo(ServoGoal::Joint([f64::NAN; 3], 2));
        command.stamp = Nanos::ZERO;
        command
    };
    let mut bench = Bench::paused();
    let mut command = bad(&mut bench);
    command.client_id = 0;
    assert_eq!(bench.send(command), Refusal::Malformed);
    command.client_id = CLIENT;
    assert_eq!(bench.send(command), Refusal::NotFinite);
    command.goal = ServoGoal::Joint(rad(50.0, 0.0), 2);
    command.deadline = Nanos::from_millis(2000);
    assert_eq!(bench.send(command), Refusal::Stamp);
    command.deadline = Nanos::ZERO;
    assert_eq!(bench.send(command), Refusal::Stale);
    command.stamp = bench.now;
    assert_eq!(bench.send(command), Refusal::Paused);
    bench.ask(StateCommand::Resume);
    bench.drives[0].feedback.homed = false;
    command.stamp = bench.now;
    assert_eq!(bench.send(command), Refusal::NotHomed);
    bench.drives[0].feedback.homed = true;
    let mut other = bench.servo(HERE);
    (other.client_id, other.sequence) = (8, 1);
    assert_eq!(bench.send(other), Refusal::None);
    assert_eq!(bench.send(command), Refusal::Lease);
    (command.client_id, command.sequence) = (8, 1);
    assert_eq!(bench.send(command), Refusal::Sequence);
    command.sequence = 2;
    assert_eq!(bench.send(command), Refusal::Stamp, "before that of the last one");
    command.stamp = bench.now;
    assert_eq!(bench.send(command), Refusal::StepTooLarge);
}

#[test]
fn repeated_refusals_are_counted_but_are_one_event() {
    let mut bench = Bench::enabled();
    let refusal_events = |bench: &Bench| {
        bench.events.iter().filter(|e| matches!(e, CycleEventKind::Refused { .. })).count()
    };
    for _ in 0..20 {
        assert_eq!(bench.joint(30.0, 0.0), Refusal::StepTooLarge);
    }
    assert_eq!((bench.report().refused, refusal_events(&bench)), (20, 1));
    assert_eq!(bench.joint(f64::NAN, 0.0), Refusal::NotFinite);
    assert_eq!((bench.report().refused, refusal_events(&bench)), (21, 2));
    assert_eq!(bench.joint(0.0, 0.0), Refusal::None);
    assert_eq!(bench.joint(f64::NAN, 0.0), Refusal::NotFinite);
    assert_eq!(
        (bench.report().accepted, bench.report().refused, refusal_events(&bench)),
        (1, 22, 3)
    );
}
