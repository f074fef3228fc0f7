//! The fit on snakes of its own kind with known parameters.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::stop::{StopParameters, Stops};
use nalgebra::{SMatrix, SVector};

use super::error::{StopError, StopWarning};
use super::initial_guess::initial_guess;
use super::stop_fit::{StopFit, StopOptions, fit_stop};
use super::stop_mechanism::StopMechanism;
use super::structure::Structure;
use crate::progress::Silent;
use crate::quality::Finding;
use crate::recording::Recording;
use crate::series::Series;
use crate::testing::{assert_near, noise, one_motor, recording, straight, wander, with_threads};

/// Few guesses and few stops: the search is short.
fn options(structures: &[Structure]) -> StopOptions {
    StopOptions { structures: structures.to_vec(), starts: 1, seed: 7, known: None }
}

fn fit(recording: &Recording, structures: &[Structure]) -> Result<StopFit, StopError> {
    fit_stop(&Series::whole(recording), &options(structures), &Silent)
}

/// One segment with two stops.
const SIMPLE: Structure = Structure::new(1, 2);

/// A snake whose parameters are not those that the search starts from.
fn truth() -> StopParameters {
    let gain = SMatrix::<f64, 2, 2>::new(0.035, -0.03, 0.03, 0.035);
    let mut truth = initial_guess(&gain, &SVector::from([20.0, -35.0]), 25.0, SIMPLE);
    truth.base_friction = 1.6;
    for (motor, slack) in truth.motors.iter_mut().zip([[0.9, 0.4], [0.3, 0.6]]) {
        motor.slack = slack;
        motor.friction = [0.12, 0.3];
    }
    truth
}

/// What a snake does, with noise.
fn two_axes(rows: usize, noise_deg: f64) -> Recording {
    let operator = Stops::<2>::prepare(&truth()).unwrap();
    let mut state = operator.begin(&SVector::from(wander(0.0)));
    let mut noise = noise(3);
    recording(rows, |time| {
        let counts = wander(time);
        operator.advance(&mut state, &SVector::from(counts));
        let bend = operator.bend(&state);
        let pitch = bend[0] + 3.0 + noise_deg * noise();
        (counts, [pitch, bend[1] - 2.0 + noise_deg * noise()])
    })
}

#[test]
fn a_snake_of_this_kind_is_found_again() {
    let fit = fit(&two_axes(1500, 0.02), &[SIMPLE]).unwrap();
    let (rms, linear_rms) = (fit.rms, fit.linear_rms);
    assert!(rms < 0.06 && linear_rms > 0.5 && fit.warnings.is_empty(), "{rms} of {linear_rms}");
    let truth = StopMechanism::new::<2>(&truth(), 1.0).unwrap();
    for (found, truth) in fit.mechanism.motors.iter().zip(truth.motors) {
        assert_near(found.axis_deg, truth.axis_deg, 1.0);
        assert_near(found.slack / truth.slack, 1.0, 0.35);
        assert_near(found.gain_per_count / truth.gain_per_count, 1.0, 0.05);
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let recording = two_axes(200, 0.02);
    let run = |threads| with_threads(threads, || fit(&recording, &[SIMPLE]).unwrap());
    assert_eq!(run(1), run(3));
}

/// A snake with one motor that has a structure.
fn one_axis(structure: Structure, rows: usize, noise_deg: f64) -> Recording {
    let gain = SMatrix::<f64, 1, 1>::new(0.04);
    let truth = initial_guess(&gain, &SVector::from([10.0]), 20.0, structure);
    let operator = Stops::<1>::prepare(&truth).unwrap();
    let mut state = operator.begin(&SVector::from([wander(0.0)[0]]));
    let mut noise = noise(8);
    one_motor(rows, |time| {
        let count = wander(time)[0];
        operator.advance(&mut state, &SVector::from([count]));
        (count, operator.bend(&state)[0] + noise_deg * noise())
    })
}

#[test]
fn one_motor_is_enough() {
    let recording = one_axis(Structure::new(1, 3), 900, 0.0);
    let fit = fit(&recording, &[Structure::new(1, 1), SIMPLE]).unwrap();
    assert!(fit.rms < 0.1 * fit.linear_rms, "{} of {}", fit.rms, fit.linear_rms);
    let [(_, one), (_, two)] = fit.tried[..] else { panic!("{:?}", fit.tried) };
    assert!(two < one && fit.parameters.stops.len() == 2, "{one} {two}");
}

#[test]
fn the_number_of_segments_is_found() {
    let fit = |segments: usize| {
        let recording = one_axis(Structure::new(segments, 2), 900, 0.02);
        fit(&recording, &[1, 2].map(|segments| Structure::new(segments, 2))).unwrap()
    };
    let (one, two) = (fit(1), fit(2));
    assert_eq!(one.mechanism.segments, 1, "{:?}", one.tried);
    assert_eq!(two.mechanism.segments, 2, "{:?}", two.tried);
    assert!(two.tried[1].1 < 0.7 * two.tried[0].1, "{:?}", two.tried);
}

#[test]
fn a_recording_without_reversals_is_refused_and_one_without_hysteresis_doubted() {
    let ramp = recording(300, |time| {
        let wave = (3.0 * time).sin();
        ([10.0 * time, 200.0 * wave], [0.2 * time, wave])
    });
    let few = Finding::FewReversals { motor: 0, reversals: 0 };
    let error = fit(&ramp, &[SIMPLE]).unwrap_err();
    assert!(matches!(error, StopError::FewReversals(found) if found == few), "{error}");
    let mut noise = noise(5);
    let straight = recording(600, |time| {
        let counts = wander(time);
        (counts, straight(counts).map(|angle| angle + 0.4 * noise()))
    });
    let warnings = fit(&straight, &[SIMPLE]).unwrap().warnings;
    assert!(matches!(warnings[..], [StopWarning::LittleGain { .. }]), "{warnings:?}");
}

#[test]
fn options_and_recordings_that_make_no_sense_are_refused() {
    let short = two_axes(100, 0.0);
    let [none, many] = [Structure::new(1, 0), Structure::new(3, 6)];
    for structures in [&[][..], &[none], &[SIMPLE, many], &[Structure::new(4, 1)]] {
        let error = fit(&short, structures).unwrap_err();
        assert!(matches!(error, StopError::Structures { .. }), "{error}");
    }
    let error = fit(&short, &[SIMPLE]).unwrap_err();
    assert!(matches!(error, StopError::FewSamples { .. }), "{error}");
}
