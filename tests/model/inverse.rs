//! The inverse: the nearest pose, warm starts, and models with several inverses.

use proptest::prelude::*;

use super::*;

fn mean(model: &Model, counts: &MotorVec) -> OutputVec {
    model.predict(counts, &model.new_memory()).mean
}

fn invert(model: &Model, goal: &OutputVec, start: &MotorVec) -> Inverse {
    model.invert(goal, &model.new_memory(), &Query::new(*start))
}

/// Checks that no position on a fine lattice over the hull is nearer to the goal than the result,
/// with a tolerance of one count's worth.
fn check_nearest(map: &SmoothMap, goal: OutputVec) {
    let model = Model::from_file(map.file()).unwrap();
    let inverse = invert(&model, &goal, &[0.0, 0.0]);
    let used_goal = &goal[..model.outputs()];
    let coordinate = |step: i32| REACH * f64::from(step) / 50.0;
    let columns = if model.motors() == 1 { 0..1 } else { -50..51 };
    let lattice =
        (-50..51).flat_map(|i| columns.clone().map(move |j| [coordinate(i), coordinate(j)]));
    let nearest = lattice
        .map(|at| distance(&mean(&model, &at)[..used_goal.len()], used_goal))
        .fold(f64::INFINITY, f64::min);
    let slack = one_count(&model, &inverse.counts, &model.new_memory());
    assert!(
        inverse.residual <= nearest + slack,
        "{inverse:?} for {goal:?}: {nearest} exists, {slack} a count"
    );
}

fn pose() -> impl Strategy<Value = OutputVec> {
    [-1.2..1.2_f64, -1.2..1.2_f64, -1.2..1.2_f64]
}

proptest! {
    #![proptest_config(i2ris_testing::cases(48))]

    #[test]
    fn inverse_gives_the_nearest_pose(map in smooth_gmr(2, 3), goal in pose()) {
        for (motors, outputs) in [(1, 1), (2, 2), (2, 3)] {
            check_nearest(&map.of_size(motors, outputs), goal);
        }
    }
}

#[test]
fn warm_start_takes_few_evaluations_and_small_steps() {
    let map = SmoothMap { gain: vec![vec![0.02, 0.02], vec![-0.02, 0.02]], bend: 0.3, steps: 3 };
    let model = Model::from_file(map.file()).unwrap();
    let mut last = invert(&model, &[8.0 * DEG, 0.0, 0.0], &[0.0, 0.0]).counts;
    for tick in 1..2000 {
        // A circle of 8 degrees in 2 seconds at 1 kHz moves 0.025 degrees a tick: about a count.
        let turn = std::f64::consts::TAU * f64::from(tick) / 2000.0;
        let inverse = invert(&model, &[8.0 * DEG * turn.cos(), 8.0 * DEG * turn.sin(), 0.0], &last);
        assert!(inverse.iterations <= 3 && !inverse.clipped && !inverse.fell_back, "{inverse:?}");
        assert!(distance(&inverse.counts, &last) < 5.0, "{inverse:?} after {last:?}");
        last = inverse.counts;
    }
}

/// A curve that falls below -200 counts and rises above, like a model fitted to a few wrong rows.
fn valley() -> Model {
    let mixture = MixtureParameters {
        weights: vec![0.2, 0.8],
        means: vec![vec![-350.0, 3.0], vec![150.0, 4.0]],
        covariances: vec![
            vec![vec![6400.0, -128.0], vec![-128.0, 3.0]],
            vec![vec![40_000.0, 800.0], vec![800.0, 16.5]],
        ],
    };
    Model::from_file(file(1, FamilyParameters::Gmr { mixture: mixture.into() }, region(1, 500.0)))
        .unwrap()
}

#[test]
fn search_restarts_from_the_conditional_mean_at_a_local_minimum() {
    let model = valley();
    let goal = [10.0 * DEG, 0.0, 0.0];
    let inverse = invert(&model, &goal, &[-450.0, 0.0]);
    assert!(inverse.fell_back && !inverse.clipped, "{inverse:?}");
    assert!((mean(&model, &inverse.counts)[0] - goal[0]).abs() < 1e-3 * DEG);
    assert!(inverse.iterations <= 40);
    assert!(!invert(&model, &goal, &[100.0, 0.0]).fell_back);
}

#[test]
fn a_motor_without_effect_keeps_its_position() {
    let model = Model::from_file(file(1, affine(&[&[0.02, 0.0]], &[0.0]), square(1000.0))).unwrap();
    let inverse = invert(&model, &[2.0 * DEG, 0.0, 0.0], &[10.0, 333.0]);
    assert!((inverse.counts[0] - 100.0).abs() < 1e-3 && inverse.counts[1] == 333.0, "{inverse:?}");
}

#[test]
fn a_start_outside_the_hull_is_projected_into_it() {
    let model = Model::from_file(file(1, affine(&[&[0.02]], &[0.0]), region(1, 100.0))).unwrap();
    let inverse = invert(&model, &[f64::NAN, 0.0, 0.0], &[750.0, 0.0]);
    assert_eq!(inverse.counts, [100.0, 0.0]);
    assert!(inverse.clipped && inverse.residual.is_infinite() && inverse.iterations == 0);
    // Entries beyond the outputs of the model are ignored.
    assert!(!invert(&model, &[DEG, f64::NAN, f64::NAN], &[750.0, 0.0]).clipped);
}
