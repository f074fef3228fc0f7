//! Regression on counts and directions: two branches per motor, and the selection between them.

use i2ris::model::file::ModelFile;
use i2ris::model::{Memory, Model, Query};
use i2ris_testing::families::{DEG, REACH, SmoothMap, branches, file, memory_after, region};

fn branch_file(map: &SmoothMap, lags: &[f64]) -> ModelFile {
    file(map.gain.len(), branches(map, lags), region(lags.len(), REACH))
}

fn one_motor() -> (SmoothMap, Model) {
    let map = SmoothMap { gain: vec![vec![0.02]], bend: 0.2, steps: 4 };
    let model = Model::from_file(branch_file(&map, &[15.0])).unwrap();
    (map, model)
}

#[test]
fn each_branch_is_the_map_shifted_by_the_lag() {
    let (map, model) = one_motor();
    let plain = Model::from_file(map.file()).unwrap();
    let map = |at: f64| plain.predict(&[at, 0.0], &plain.new_memory()).mean[0];
    let up = memory_after(&model, &[[-100.0, 0.0], [50.0, 0.0]]);
    for at in [50.0, 48.0, 200.0, 400.0] {
        let found = model.predict(&[at, 0.0], &up).mean[0];
        assert!((found - map(at - 15.0)).abs() < 1e-9, "{at}");
    }
    // After moving back by the dead-band the other branch applies.
    for at in [46.0, 0.0, -300.0] {
        let found = model.predict(&[at, 0.0], &up).mean[0];
        assert!((found - map(at + 15.0)).abs() < 1e-9, "{at}");
    }
}

#[test]
fn prediction_without_direction_lies_between_the_branches() {
    let (_, model) = one_motor();
    let (up, down) = (
        memory_after(&model, &[[-9.0, 0.0], [0.0, 0.0]]),
        memory_after(&model, &[[9.0, 0.0], [0.0, 0.0]]),
    );
    let unknown = memory_after(&model, &[[0.0, 0.0]]);
    let at = |memory: &Memory| model.predict(&[0.0, 0.0], memory).mean[0];
    assert!(at(&up) < at(&unknown) && at(&unknown) < at(&down));
    assert_eq!(
        model.predict(&[0.0, 0.0], &model.new_memory()),
        model.predict(&[0.0, 0.0], &unknown)
    );
    assert!(model.knows(&up) && !model.knows(&unknown));
}

#[test]
fn inverse_crosses_the_backlash_once_at_a_reversal() {
    let (_, model) = one_motor();
    let mut memory = memory_after(&model, &[[-300.0, 0.0], [100.0, 0.0]]);
    let mut goal = model.predict(&[100.0, 0.0], &memory).mean;
    let mut last = [100.0, 0.0];
    let mut crossings = 0;
    for _ in 0..200 {
        goal[0] -= 0.01 * DEG;
        let inverse = model.invert(&goal, &memory, &Query::new(last));
        assert!(!inverse.clipped, "{inverse:?}");
        let step = last[0] - inverse.counts[0];
        assert!((0.0..35.0).contains(&step), "{step}");
        crossings += usize::from(step > 20.0);
        last = inverse.counts;
        model.advance(&mut memory, &last);
        assert!((model.predict(&last, &memory).mean[0] - goal[0]).abs() < 0.02 * DEG);
    }
    assert_eq!(crossings, 1);
}

#[test]
fn compensation_interpolates_from_the_mean_of_the_branches() {
    let (_, model) = one_motor();
    let memory = memory_after(&model, &[[-300.0, 0.0], [100.0, 0.0]]);
    let goal = model.predict(&[150.0, 0.0], &memory).mean;
    let counts = |compensation| {
        model.invert(&goal, &memory, &Query { compensation, ..Query::new([100.0, 0.0]) }).counts[0]
    };
    let without = model.invert(&goal, &model.new_memory(), &Query::new([100.0, 0.0])).counts[0];
    assert!((counts(1.0) - 150.0).abs() < 0.1 && (counts(0.0) - without).abs() < 1e-9);
    assert!((counts(0.5) - 0.5 * (counts(0.0) + counts(1.0))).abs() < 1e-9);
    assert!((counts(1.0) - counts(0.0) - 15.0).abs() < 1.0, "half the gap lies between");
}
