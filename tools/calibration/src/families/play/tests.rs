//! Properties of the fit of plays.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::backlash_play::Plays;
use nalgebra::{DVector, SVector};
use proptest::prelude::*;

use super::play_fit::{PlayError, fit_play};
use super::weights::{FIRST_WEIGHT, PlayStates, Thresholds, Weights, fit_weights, improve};
use crate::em::EmOptions;
use crate::families::chain::ChainOptions;
use crate::progress::Silent;
use crate::recording::Recording;
use crate::series::Series;
use crate::testing::{
    assert_near, few_starts, noise, one_motor, plays_of, recording, straight, wander, with_threads,
};

const THRESHOLDS: [f64; 5] = [0.0, 10.0, 25.0, 60.0, 120.0];

fn thresholds(some: &[f64]) -> Thresholds {
    Thresholds { motors: vec![some.to_vec(); 2], planar: Vec::new() }
}

/// A snake that is a play sum with a bent curve, with noise of the given deviation in degrees.
fn snake(rows: usize, weights: [&[f64]; 2], deviation: f64) -> Recording {
    let weights = weights.map(<[f64]>::to_vec).to_vec();
    let parameters = plays_of(vec![THRESHOLDS.to_vec(); 2], weights);
    let operator = Plays::<2>::prepare(&parameters).unwrap();
    let mut state = operator.begin(&SVector::from(wander(0.0)));
    let mut noise = noise(5);
    recording(rows, |time| {
        let counts = SVector::from(wander(time));
        operator.advance(&mut state, &counts);
        let v = operator.local(&state, &counts).mean;
        let [pitch, yaw] = straight([v[0], v[1]]);
        let bent = [
            pitch + 0.01 * pitch * pitch + deviation * noise(),
            yaw - 0.005 * yaw * pitch + deviation * noise(),
        ];
        (wander(time), bent)
    })
}

fn options() -> ChainOptions {
    let em = EmOptions { max_iterations: 50, ..few_starts(2) };
    ChainOptions { components: Some(3), em, ..ChainOptions::default() }
}

fn states(series: &Series, some: &[f64]) -> PlayStates {
    PlayStates::new(series, &thresholds(some)).unwrap()
}

fn apart(found: &DVector<f64>, expected: &[f64]) -> f64 {
    let apart = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max)
}

#[test]
fn play_weights_are_recovered_through_a_bent_curve() {
    let (first, second) = ([0.1, 0.0, 0.3, 0.6, 0.0], [0.3, 0.5, 0.0, 0.0, 0.2]);
    let series = Series::whole(&snake(1500, [&first, &second], 0.05));
    let weights = fit_weights(&states(&series, &THRESHOLDS)).unwrap();
    let apart = apart(&weights[0], &first).max(apart(&weights[1], &second));
    assert!(apart < 0.02, "{weights:?}");
}

#[test]
fn the_threshold_0_keeps_its_minimum_weight() {
    let only_wide = [0.001, 0.0, 0.0, 0.999, 0.0];
    let series = Series::whole(&snake(800, [&only_wide, &only_wide], 0.0));
    for motor in fit_weights(&states(&series, &THRESHOLDS)).unwrap() {
        assert!(motor[0] >= FIRST_WEIGHT * (1.0 - 1e-12), "{motor}");
        assert_near(motor.sum(), 1.0, 1e-12);
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let series = Series::whole(&snake(400, [&[0.1, 0.0, 0.3, 0.6, 0.0]; 2], 0.1));
    let with = |threads| with_threads(threads, || fit_play(&series, &options(), &Silent)).unwrap();
    assert_eq!(with(1), with(3));
}

#[test]
fn a_fit_finds_the_gap_of_the_mechanism() {
    let weights = [0.05, 0.0, 0.0, 0.95, 0.0];
    let series = Series::whole(&snake(900, [&weights; 2], 0.05));
    let fit = fit_play(&series, &options(), &Silent).unwrap();
    for motor in &fit.mechanism.motors {
        assert_near(motor.loop_counts, 114.0, 8.0);
        // The grid of thresholds is coarse.
        assert_near(motor.gap_counts, 120.0, 45.0);
        assert_near(motor.loop_width, motor.gain * motor.loop_counts, 1e-12);
    }
    // The axes of `straight` are turned by atan(0.015 / 0.02); the bend adds a little.
    assert_near(fit.mechanism.rotation_deg.unwrap(), 36.9, 5.0);
    assert!(fit.search_rms < 0.2, "{}", fit.search_rms);
}

#[test]
fn what_cannot_be_fitted_is_refused_with_a_reason() {
    let short = one_motor(30, |time| (50.0 * time.sin(), time));
    let few = fit_play(&Series::new(&short, &[0, 1, 2]), &options(), &Silent).unwrap_err();
    assert!(matches!(few, PlayError::TooFewSamples(3, _)), "{few}");
    // Whole, as an encoder counts: what spans so little otherwise is not in counts.
    let still = one_motor(100, |time| ((2.0 * time.sin()).round(), time));
    let still = fit_play(&Series::whole(&still), &options(), &Silent).unwrap_err();
    assert!(matches!(still, PlayError::Still(0)), "{still}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn more_plays_never_raise_the_training_error(
        shares in prop::collection::vec(0.0..1.0_f64, 5),
        added in prop::collection::vec(5.0..150.0_f64, 1..4),
    ) {
        let total: f64 = 0.1 + shares.iter().sum::<f64>();
        let mut weights: Vec<f64> = shares.iter().map(|share| share / total).collect();
        weights[0] += 0.1 / total;
        let series = Series::whole(&snake(400, [&weights, &weights], 0.1));
        let few = [0.0, 20.0, 80.0];
        let mut more = few.to_vec();
        more.extend(added.iter().filter(|added| !few.contains(added)));
        more.sort_by(f64::total_cmp);
        let rows = states(&series, &more).rows().min(200);
        let last = |some: &[f64]| states(&series, some).thinned(rows, rows);
        let small = last(&few);
        let (weights, before) = improve(&small, fit_weights(&small).unwrap()).unwrap();
        // Weights of the new plays start at 0.
        let weight = |threshold: f64, motor: &DVector<f64>| {
            few.iter().position(|few| *few == threshold).map_or(0.0, |i| motor[i])
        };
        let pad = |motor| DVector::from_fn(more.len(), |i, _| weight(more[i], motor));
        let padded: Weights = weights.iter().map(pad).collect();
        let (_, after) = improve(&last(&more), padded).unwrap();
        prop_assert!(after <= before * (1.0 + 1e-9), "{after} instead of {before}");
    }
}
