//! What the fit of plays promises.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::backlash_play::{PlayParameters, Plays};
use nalgebra::{DVector, SVector};
use proptest::prelude::*;

use super::baseline::LinearPlays;
use super::stage::{Stage, Thresholds};
use super::weights::{FIRST_WEIGHT, Weights, fit_weights, improve};
use super::{PlayError, PlayOptions, fit_play};
use crate::chain::ChainOptions;
use crate::em::EmOptions;
use crate::progress::Silent;
use crate::recording::Recording;
use crate::series::Series;
use crate::testing::{noise, one_motor, recording, straight, wander};

const THRESHOLDS: [f64; 5] = [0.0, 10.0, 25.0, 60.0, 120.0];

fn thresholds(some: &[f64]) -> Thresholds {
    Thresholds {
        motors: vec![some.to_vec(); 2],
        planar: Vec::new(),
    }
}

/// A snake that is a play sum behind a bent curve, with noise of a deviation in degrees.
fn snake(rows: usize, weights: [&[f64]; 2], deviation: f64) -> Recording {
    let parameters = PlayParameters {
        thresholds_counts: vec![THRESHOLDS.to_vec(); 2],
        weights: weights.map(<[f64]>::to_vec).to_vec(),
        planar_thresholds_counts: Vec::new(),
    };
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

fn all(recording: &Recording) -> Series {
    Series::new(recording, &(0..recording.rows().len()).collect::<Vec<_>>())
}

fn options() -> PlayOptions {
    let em = EmOptions {
        restarts: 2,
        max_iterations: 50,
        ..EmOptions::default()
    };
    PlayOptions {
        chain: ChainOptions {
            components: Some(3),
            residual: true,
            em,
        },
    }
}

fn apart(found: &DVector<f64>, expected: &[f64]) -> f64 {
    found
        .iter()
        .zip(expected)
        .map(|(found, expected)| (found - expected).abs())
        .fold(0.0, f64::max)
}

#[test]
fn the_weights_of_a_play_sum_are_recovered_through_a_bent_curve() {
    let (first, second) = ([0.1, 0.0, 0.3, 0.6, 0.0], [0.3, 0.5, 0.0, 0.0, 0.2]);
    let series = all(&snake(1500, [&first, &second], 0.05));
    let weights =
        fit_weights(&Stage::<2>::new(&series, &thresholds(&THRESHOLDS)).unwrap()).unwrap();
    assert!(
        apart(&weights[0], &first) < 0.02 && apart(&weights[1], &second) < 0.02,
        "{weights:?}"
    );
}

#[test]
fn the_inverse_always_gets_its_share_of_the_threshold_0() {
    let only_wide = [0.001, 0.0, 0.0, 0.999, 0.0];
    let series = all(&snake(800, [&only_wide, &only_wide], 0.0));
    let weights =
        fit_weights(&Stage::<2>::new(&series, &thresholds(&THRESHOLDS)).unwrap()).unwrap();
    for motor in &weights {
        assert!(
            motor[0] >= FIRST_WEIGHT * (1.0 - 1e-12) && (motor.sum() - 1.0).abs() < 1e-12,
            "{motor}"
        );
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let series = all(&snake(400, [&[0.1, 0.0, 0.3, 0.6, 0.0]; 2], 0.1));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| fit_play(&series, &options(), &Silent))
            .unwrap()
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn a_fit_reads_the_gap_of_the_mechanism_and_passes_for_a_model() {
    let weights = [0.05, 0.0, 0.0, 0.95, 0.0];
    let fit = fit_play(&all(&snake(900, [&weights; 2], 0.05)), &options(), &Silent).unwrap();
    for motor in &fit.reading.motors {
        assert!((motor.loop_counts - 114.0).abs() < 8.0, "{:?}", fit.reading);
        assert!(
            (motor.gap_counts - 120.0).abs() < 45.0,
            "the grid is coarse: {:?}",
            fit.reading
        );
        assert!((motor.loop_width - motor.gain * motor.loop_counts).abs() < 1e-12);
    }
    // The axes of `straight` are turned by atan(0.015 / 0.02); the bend adds a little.
    assert!(
        (fit.reading.rotation_deg.unwrap() - 36.9).abs() < 5.0,
        "{:?}",
        fit.reading
    );
    assert!(fit.search_rms < 0.2, "{}", fit.search_rms);
}

#[test]
fn plays_with_a_linear_read_out_explain_a_play_sum_on_later_rows() {
    let recording = one_motor(600, {
        let operator = Plays::<1>::prepare(&PlayParameters {
            thresholds_counts: vec![vec![0.0, 40.0]],
            weights: vec![vec![0.2, 0.8]],
            planar_thresholds_counts: Vec::new(),
        })
        .unwrap();
        let mut state = operator.begin(&SVector::from([wander(0.0)[0]]));
        move |time| {
            let counts = SVector::from([wander(time)[0]]);
            operator.advance(&mut state, &counts);
            (counts[0], 0.02 * operator.local(&state, &counts).mean[0])
        }
    });
    let baseline =
        LinearPlays::fit(&Series::new(&recording, &(0..400).collect::<Vec<_>>())).unwrap();
    let later = Series::new(&recording, &(400..600).collect::<Vec<_>>());
    let predicted = baseline.predict(&later).unwrap();
    let error = |(sample, predicted): (&crate::series::Sample, &[f64; 3])| {
        (sample.outputs[0] - predicted[0]).powi(2)
    };
    let rms = (later
        .samples()
        .iter()
        .zip(&predicted)
        .map(error)
        .sum::<f64>()
        / 200.0)
        .sqrt();
    assert!(rms < 0.12, "{rms}; the loop is 1.28 deg wide");
}

#[test]
fn what_cannot_be_fitted_is_refused_with_a_reason() {
    let short = one_motor(30, |time| (50.0 * time.sin(), time));
    let few = fit_play(&Series::new(&short, &[0, 1, 2]), &options(), &Silent).unwrap_err();
    assert!(
        matches!(few, PlayError::TooFewSamples { samples: 3, .. }),
        "{few}"
    );
    let still = one_motor(100, |time| (2.0 * time.sin(), time));
    let still = fit_play(&all(&still), &options(), &Silent).unwrap_err();
    assert!(
        still.to_string().contains("motor 0 hardly moves"),
        "{still}"
    );
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
        let series = all(&snake(400, [&weights, &weights], 0.1));
        let few = [0.0, 20.0, 80.0];
        let mut more = few.to_vec();
        more.extend(added.iter().filter(|added| !few.contains(added)));
        more.sort_by(f64::total_cmp);
        let rows = Stage::<2>::new(&series, &thresholds(&more)).unwrap().rows().min(200);
        let last = |some: &[f64]| Stage::<2>::new(&series, &thresholds(some)).unwrap().thinned(rows, rows);
        let small = last(&few);
        let (weights, before) = improve(&small, fit_weights(&small).unwrap()).unwrap();
        // Those of the new plays start at 0.
        let at = |threshold: f64, motor: &DVector<f64>| few.iter().position(|few| *few == threshold).map_or(0.0, |i| motor[i]);
        let padded: Weights = weights.iter().map(|motor| DVector::from_fn(more.len(), |i, _| at(more[i], motor))).collect();
        let (_, after) = improve(&last(&more), padded).unwrap();
        prop_assert!(after <= before * (1.0 + 1e-9), "{after} instead of {before}");
    }
}
