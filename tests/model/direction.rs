//! Regression on counts and directions: two branches per motor, and the selection between them.

use i2ris::model::file::{FamilyParameters, MixtureParameters, ModelFile};
use i2ris::model::{Memory, Model, Query};
use i2ris::units::MotorVec;
use proptest::collection::vec;
use proptest::prelude::*;

use super::samples::{
    DEG, REACH, SmoothMap, any_number, assert_jacobian, distance, file, memory_after, one_count,
    position, region, smooth_gmr,
};

const DEAD_BAND: f64 = 4.0;

/// The branches of a smooth map: every motor lags by its lag, counts, in the direction of its
/// travel. The direction `s` of a motor is a variable of variance 1, and the counts of the map are
/// `counts - lag s`.
fn branches(map: &SmoothMap, lags: &[f64]) -> FamilyParameters {
    let FamilyParameters::Gmr { mixture } = map.family() else { panic!() };
    let motors = lags.len();
    let size = mixture.means[0].len() + motors;
    // A row of the whole mixture: coefficients of the variables of the map, and of the directions.
    let row = |variable: usize| -> (Option<usize>, Option<(usize, f64)>) {
        if variable < motors {
            (Some(variable), Some((variable, lags[variable])))
        } else if variable < 2 * motors {
            (None, Some((variable - motors, 1.0)))
        } else {
            (Some(variable - motors), None)
        }
    };
    let covariance = |inner: &Vec<Vec<f64>>| -> Vec<Vec<f64>> {
        let entry = |i: usize, j: usize| {
            let ((a, s), (b, t)) = (row(i), row(j));
            let within = a.zip(b).map_or(0.0, |(a, b)| inner[a][b]);
            let between = s.zip(t).map_or(0.0, |((s, x), (t, y))| if s == t { x * y } else { 0.0 });
            within + between
        };
        (0..size).map(|i| (0..size).map(|j| entry(i, j)).collect()).collect()
    };
    let mean = |inner: &Vec<f64>| -> Vec<f64> {
        let (counts, outputs) = inner.split_at(motors);
        [counts, &vec![0.0; motors], outputs].concat()
    };
    let mixture = MixtureParameters {
        weights: mixture.weights.clone(),
        means: mixture.means.iter().map(mean).collect(),
        covariances: mixture.covariances.iter().map(covariance).collect(),
    };
    FamilyParameters::GmrDirection { dead_bands_counts: vec![DEAD_BAND; motors], mixture }
}

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

#[test]
fn sizes_and_dead_bands_are_checked() {
    let map = SmoothMap { gain: vec![vec![0.02, 0.0], vec![0.0, 0.02]], bend: 0.0, steps: 1 };
    let refused = |change: fn(&mut Vec<f64>, &mut MixtureParameters)| {
        let mut file = branch_file(&map, &[5.0, 5.0]);
        let FamilyParameters::GmrDirection { dead_bands_counts, mixture } = &mut file.family else {
            panic!()
        };
        change(dead_bands_counts, mixture);
        Model::from_file(file).unwrap_err().to_string()
    };
    assert!(
        refused(|bands, _| bands[1] = 0.5)
            .contains("dead_bands_counts = [4.0, 0.5]: must be at least one count")
    );
    assert!(refused(|bands, _| bands.truncate(1)).contains("one per motor"));
    assert!(refused(|bands, _| bands[0] = f64::NAN).contains("dead_bands_counts"));
    assert!(refused(|_, mixture| mixture.means[0].truncate(4)).contains("means[0]"));
}

fn check_round_trip(
    map: &SmoothMap,
    lags: &[f64],
    path: &[MotorVec],
    at: MotorVec,
    start: MotorVec,
) {
    let model = Model::from_file(branch_file(map, lags)).unwrap();
    let memory = memory_after(&model, path);
    let goal = model.predict(&at, &memory).mean;
    let inverse = model.invert(&goal, &memory, &Query::new(start));
    let missed = distance(&model.predict(&inverse.counts, &memory).mean, &goal);
    let worth = one_count(&model, &at, &memory);
    assert!(missed <= worth, "{inverse:?} for {at:?} misses {missed}, and a count is {worth}");
    assert!(!inverse.clipped && model.hull().contains(&inverse.counts), "{inverse:?}");
}

fn path(motors: usize) -> impl Strategy<Value = Vec<MotorVec>> {
    vec(position(motors), 2..8)
}

proptest! {
    #![proptest_config(i2ris_testing::cases(32))]

    #[test]
    fn inverse_recovers_the_counts_on_branches(
        map in smooth_gmr(2, 3),
        lags in [0.0..40.0_f64, 0.0..40.0_f64],
        p in path(2),
        at in position(2),
        start in position(2),
    ) {
        let one = |at: MotorVec| [at[0], 0.0];
        let along: Vec<MotorVec> = p.iter().copied().map(one).collect();
        check_round_trip(&map.of_size(1, 1), &lags[..1], &along, one(at), one(start));
        check_round_trip(&map.of_size(2, 2), &lags, &p, at, start);
        check_round_trip(&map, &lags, &p, at, start);
    }

    #[test]
    fn inverse_stays_in_the_hull_for_every_goal(
        map in smooth_gmr(2, 2),
        lags in [0.0..40.0_f64, 0.0..40.0_f64],
        p in path(2),
        goal in [any_number(), any_number(), any_number()],
        start in [any_number(), any_number()], compensation in 0.0..1.0_f64,
    ) {
        let model = Model::from_file(branch_file(&map, &lags)).unwrap();
        let inverse = model.invert(
            &goal,
            &memory_after(&model, &p),
            &Query { compensation, ..Query::new(start) },
        );
        prop_assert!(
            model.hull().contains(&inverse.counts) && inverse.residual >= 0.0,
            "{:?}",
            inverse,
        );
        if goal[..2].iter().any(|g| !g.is_finite()) {
            prop_assert!(inverse.clipped && inverse.residual.is_infinite(), "{:?}", inverse);
        }
        // 20 evaluations from each of two starts, for 9 solves and the solve without memory.
        prop_assert!(inverse.iterations <= 400);
    }

    #[test]
    fn jacobian_matches_the_numerical_derivative_of_the_branch(
        map in smooth_gmr(2, 2),
        p in path(2),
        at in position(2),
    ) {
        let model = Model::from_file(branch_file(&map, &[10.0, 20.0])).unwrap();
        let memory = memory_after(&model, &[p.as_slice(), &[at]].concat());
        assert_jacobian(&model, at, &memory, [0.0, 1e-9]);
    }
}
