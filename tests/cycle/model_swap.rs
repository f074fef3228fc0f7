//! Model swap and rollback: without a step, and with the same past.

use i2ris::model::History;
use proptest::prelude::*;

use super::network::swap_while_moving;
use super::*;

/// Enabled with a model with memory that has seen enough motion to know where it is.
fn conditioned(model: &Arc<Model>) -> Bench {
    let mut bench = Bench::enabled_with(config(""), Some(Arc::clone(model)));
    bench.carry_out(StateCommand::Condition);
    assert!(bench.joints().memory_known);
    bench.pose = Some((rad(0.0, 0.0), 2));
    bench.carry_out(StateCommand::Move);
    bench
}

/// Sends angles along a slow figure for a number of commands, 5 ticks each.
fn figure(bench: &mut Bench, from: u32, commands: u32, mut between: impl FnMut(&mut Bench, u32)) {
    for k in from..from + commands {
        let t = f64::from(k) * 0.005;
        assert_eq!(bench.joint(4.0 * (2.0 * t).sin(), 3.0 * (3.1 * t).sin()), Refusal::None);
        between(bench, k);
        bench.run(4);
    }
}

/// Twice the turning band: a goal that returns by less is not followed.
const HELD: f64 = 0.1;

fn hold(bench: &mut Bench, pitch: f64, yaw: f64, commands: u32) {
    for _ in 0..commands {
        assert_eq!(bench.joint(pitch, yaw), Refusal::None);
        bench.run(9);
    }
}

#[test]
fn swap_keeps_motors_then_blends_to_new_inverse() {
    let (first, second) = (standard_model(), scaled_standard_model(1.25));
    let mut bench = conditioned(&first);
    hold(&mut bench, 4.0, 1.0, 150);
    let before = bench.targets();
    assert_eq!(bench.swap(&second), Refusal::None);
    assert_eq!(bench.targets(), before);
    let joints = bench.joints();
    assert_eq!(joints.model, second.id());
    let apart = (joints.setpoint[0].to_degrees() - 4.0).abs();
    assert!(apart > 0.5, "the new model sees another angle: {joints:?}");
    assert_eq!(joints.goal, rad(4.0, 1.0), "the goal stays as requested");
    hold(&mut bench, 4.0, 1.0, 20);
    let half_way = bench.targets();
    assert!(half_way[0] < before[0] - 5, "{before:?} {half_way:?}");
    hold(&mut bench, 4.0, 1.0, 60);
    let joints = bench.joints();
    assert!((joints.setpoint[0].to_degrees() - 4.0).abs() < 0.01, "{joints:?}");
    assert!(bench.targets()[0] < half_way[0] - 5);
    let swapped = CycleEventKind::Model { from: Some(first.id()), to: second.id() };
    assert!(bench.events.contains(&swapped));
}

#[test]
fn goal_is_reached_again_after_rollback() {
    let (first, second) = (standard_model(), scaled_standard_model(0.8));
    let mut bench = conditioned(&first);
    hold(&mut bench, 3.0, -2.0, 150);
    let before = bench.targets();
    assert_eq!(bench.swap(&second), Refusal::None);
    hold(&mut bench, 3.0, -2.0, 5);
    assert_eq!(bench.change_model(ModelChange::Rollback, false), Refusal::None);
    assert_eq!(bench.report().models.active, Some(first.id()));
    assert_eq!(bench.report().models.previous, Some(second.id()));
    hold(&mut bench, 3.0, -2.0, 150);
    // In between it moved back and forth by some counts; plays forget only what the goal requires.
    for (after, before) in bench.targets().iter().zip(before) {
        assert!((after - before).abs() <= 210, "{after} {before}");
    }
    let joints = bench.joints();
    assert!((joints.setpoint[0].to_degrees() - 3.0).abs() < 0.01, "{joints:?}");
}

#[test]
fn staged_model_takes_over_memory_of_active_model() {
    let first = standard_model();
    let mut bench = conditioned(&first);
    figure(&mut bench, 0, 300, |_, _| {});
    let candidate = bench.candidate(&first);
    // The motors move for another second before the loop gets it.
    figure(&mut bench, 300, 180, |_, _| {});
    bench.offer(candidate);
    let activate = ModelChange::Activate(first.id());
    assert_eq!(bench.change_model(activate, false), Refusal::Busy, "not caught up");
    bench.run(200);
    let before = bench.joints();
    assert_eq!(bench.change_model(ModelChange::Activate(first.id()), false), Refusal::None);
    let after = bench.joints();
    for (before, after) in before.measured.iter().zip(after.measured) {
        assert!((before - after).abs() < recalled_within(0.01), "{before} {after}");
    }
}

/// Error of a memory recalled from a history, rad. Its points are up to 8 counts apart. Plays and
/// constant friction end exactly where the whole motion ends. Friction proportional to the tension
/// before the step, and motors that move together from point to point, do not.
fn recalled_within(counts: f64) -> f64 {
    if lag_counts().is_some() { 1e-9 } else { counts * GAIN_DEG.to_radians() }
}

#[test]
fn recalled_history_matches_memory_of_whole_motion() {
    // The fitted model is off by 3.6 counts after 14 s of this motion.
    let Some(_) = lag_counts() else { return };
    let model = standard_model();
    let (mut whole, mut history) = (model.new_memory(), History::default());
    for k in 1..=20_000 {
        let t = 1e-3 * f64::from(k);
        let counts = [300.0 * (1.3 * t).sin() + 200.0 * (4.7 * t).sin(), 500.0 * (1.7 * t).sin()];
        let counts = counts.map(f64::round);
        model.advance(&mut whole, &counts);
        history.note(&counts);
        if k % 2000 == 0 {
            let recalled = model.recall(&history);
            let [a, b] = [whole, recalled].map(|memory| model.predict(&counts, &memory).mean);
            let apart = (a[0] - b[0]).hypot(a[1] - b[1]);
            assert!(apart < recalled_within(0.0), "{apart} rad after {k}");
        }
    }
}

#[test]
fn candidate_staged_too_late_has_unknown_memory() {
    let first = model_with_memory();
    let mut bench = conditioned(&first);
    let candidate = bench.candidate(&first);
    bench.run(1100);
    bench.offer(candidate);
    bench.run(2);
    let activate = ModelChange::Activate(first.id());
    assert_eq!(bench.change_model(activate, false), Refusal::MemoryUnknown);
    assert_eq!(bench.change_model(activate, true), Refusal::None);
    assert!(!bench.joints().memory_known);
}

#[test]
fn homing_makes_every_memory_unknown() {
    let first = model_with_memory();
    let mut bench = conditioned(&first);
    bench.offer(bench.candidate(&first));
    bench.run(2);
    assert!(bench.report().models.staged_known);
    bench.carry_out(StateCommand::Disable);
    bench.home();
    assert!(!bench.report().models.staged_known);
    let activate = ModelChange::Activate(first.id());
    assert_eq!(bench.change_model(activate, false), Refusal::MemoryUnknown);
}

#[test]
fn first_model_can_be_activated_while_enabled() {
    let mut bench = Bench::enabled_with(config(""), None);
    assert_eq!(bench.joint(0.0, 0.0), Refusal::NoModel);
    let first = standard_model();
    bench.stage(&first);
    assert_eq!(bench.change_model(ModelChange::Activate(first.id()), true), Refusal::None);
    assert_eq!(bench.change_model(ModelChange::Rollback, false), Refusal::NoPreviousModel);
    hold(&mut bench, 2.0, 0.0, 100);
    let Some(lag) = lag_counts() else { return };
    for (target, wanted) in bench.targets().iter().zip(counts_at(2.0, 0.0)) {
        assert!((f64::from(*target) - wanted - lag).abs() <= 0.51);
    }
}

#[test]
fn an_impossible_swap_is_refused_and_changes_nothing() {
    let (first, second, tip) = (standard_model(), scaled_balance_model(1.1), model(OutputUnit::Mm));
    let mut bench = Bench::enabled();
    let activate = |model: &Arc<Model>| ModelChange::Activate(model.id());
    assert_eq!(bench.change_model(activate(&second), true), Refusal::NothingStaged);
    assert_eq!(bench.change_model(ModelChange::Rollback, true), Refusal::NoPreviousModel);
    bench.stage(&second);
    // A different model is staged.
    assert_eq!(bench.change_model(activate(&first), true), Refusal::NothingStaged);
    assert_eq!(bench.change_model(activate(&second), false), Refusal::MemoryUnknown);
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
    assert_eq!(bench.change_model(activate(&second), true), Refusal::Conditioning);
    bench.idle();
    bench.stage(&tip);
    assert_eq!(bench.joint(0.1, 0.0), Refusal::None);
    // Angles are not a tip position.
    assert_eq!(bench.change_model(activate(&tip), false), Refusal::WrongState);
    assert_eq!(bench.report().models.active, Some(first.id()));
    assert_eq!(bench.ask(StateCommand::Release), Refusal::None);
    assert_eq!(bench.change_model(activate(&tip), false), Refusal::None);
}

#[test]
fn a_thousand_swaps_during_motion_stay_within_the_limits() {
    let models = [standard_model(), scaled_standard_model(1.2)];
    let mut bench = Bench::new(config(""), Some(models[0].clone()));
    swap_while_moving(&mut bench, &models, 1000);
}

/// Pitch motion of half a count of every motor, beyond the gaps.
fn half_a_count_deg(model: &Model) -> f64 {
    let pitch = |counts| model.predict(&counts, &model.new_memory()).mean[0].to_degrees();
    let ways = [[200.0, 0.0], [0.0, 200.0]]
        .map(|[a, b]| (pitch([2.0 * a, 2.0 * b]) - pitch([a, b])).abs());
    ways.iter().sum::<f64>() / 400.0
}

proptest! {
    #![proptest_config(i2ris_testing::cases(16))]

    /// The motors keep their limits, and finally the goal is reached.
    #[test]
    fn any_model_can_be_activated_at_any_time(
        factor in 0.5..2.0_f64, ticks in 0..150_usize, pitch in -4.0..4.0_f64
    ) {
        let (first, second) = (standard_model(), scaled_standard_model(factor));
        let mut bench = conditioned(&first);
        for k in 0..40 {
            let _ = bench.joint(pitch * f64::from(k) / 40.0, 0.0);
            bench.run(4);
        }
        bench.run(ticks % 40);
        prop_assert_eq!(bench.swap(&second), Refusal::None);
        hold(&mut bench, pitch, 0.0, 200);
        let joints = bench.joints();
        let error = (joints.setpoint[0] - joints.goal[0]).to_degrees().abs();
        // A motor crosses no gap for half a count.
        prop_assert!(error < HELD + half_a_count_deg(&second), "{:?}", joints);
    }
}

/// A goal in counts does not depend on the model.
#[test]
fn counts_that_are_followed_do_not_change() {
    let mut bench = Bench::enabled();
    for _ in 0..50 {
        let command = bench.servo(ServoGoal::Actuator([Counts(100), Counts(-50)], 2));
        assert_eq!(bench.send(command), Refusal::None);
        bench.run(4);
    }
    assert_eq!(bench.targets(), [100, -50]);
    bench.stage(&scaled_standard_model(1.3));
    let id = scaled_standard_model(1.3).id();
    assert_eq!(bench.change_model(ModelChange::Activate(id), true), Refusal::None);
    assert_eq!(bench.targets(), [100, -50]);
}
