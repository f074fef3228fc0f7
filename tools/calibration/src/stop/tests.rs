//! The fit on snakes of its own kind, where the truth is known.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::stop::Stops;
use nalgebra::{SMatrix, SVector};

use super::*;
use crate::identify::Finding;
use crate::recording::Recording;
use crate::testing::{noise, one_motor, recording, wander};

/// Few guesses and few stops: the search is short.
fn short() -> StopOptions {
    StopOptions {
        structures: vec![one_segment(2)],
        starts: 1,
        seed: 7,
    }
}

fn one_segment(stops: usize) -> Structure {
    Structure { segments: 1, stops }
}

fn whole(recording: &Recording) -> Series {
    Series::new(recording, &(0..recording.rows().len()).collect::<Vec<_>>())
}

/// A snake whose parameters are not those that the search starts from.
fn truth() -> StopParameters {
    let gain = SMatrix::<f64, 2, 2>::new(0.035, -0.03, 0.03, 0.035);
    let mut truth = start::start(&gain, &SVector::from([20.0, -35.0]), 25.0, one_segment(2));
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
        (
            counts,
            [
                bend[0] + 3.0 + noise_deg * noise(),
                bend[1] - 2.0 + noise_deg * noise(),
            ],
        )
    })
}

#[test]
fn a_snake_of_this_kind_is_found_again() {
    let fit = fit_stop(&whole(&two_axes(1500, 0.02)), &short(), &Silent).unwrap();
    assert!(
        fit.rms < 0.06,
        "{} where a straight line leaves {}",
        fit.rms,
        fit.linear_rms
    );
    assert!(
        fit.linear_rms > 0.5 && fit.warnings.is_empty(),
        "{}",
        fit.linear_rms
    );
    let truth = StopReading::new::<2>(&truth(), 1.0).unwrap();
    for (found, true_one) in fit.reading.motors.iter().zip(truth.motors) {
        assert!(
            (found.axis_deg - true_one.axis_deg).abs() < 1.0,
            "{found:?}"
        );
        assert!(
            (found.slack / true_one.slack - 1.0).abs() < 0.35,
            "{found:?}"
        );
        assert!(
            (found.gain_per_count / true_one.gain_per_count - 1.0).abs() < 0.05,
            "{found:?}"
        );
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let series = whole(&two_axes(200, 0.02));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| fit_stop(&series, &short(), &Silent).unwrap())
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn one_motor_is_a_snake_as_well() {
    let gain = SMatrix::<f64, 1, 1>::new(0.04);
    let operator = Stops::<1>::prepare(&start::start(
        &gain,
        &SVector::from([10.0]),
        20.0,
        one_segment(3),
    ))
    .unwrap();
    let mut state = operator.begin(&SVector::from([wander(0.0)[0]]));
    let recording = one_motor(900, |time| {
        let count = wander(time)[0];
        operator.advance(&mut state, &SVector::from([count]));
        (count, operator.bend(&state)[0])
    });
    let fit = fit_stop(
        &whole(&recording),
        &StopOptions {
            structures: [1, 2].map(one_segment).to_vec(),
            ..short()
        },
        &Silent,
    )
    .unwrap();
    assert!(
        fit.rms < 0.1 * fit.linear_rms,
        "{} of {}",
        fit.rms,
        fit.linear_rms
    );
    let [(_, one), (_, two)] = fit.tried[..] else {
        panic!("{:?}", fit.tried)
    };
    assert!(two < one && fit.parameters.stops.len() == 2, "{one} {two}");
}

#[test]
fn a_snake_that_bends_in_stretches_is_told_from_one_that_does_not() {
    let of = |segments: usize, rows: usize| {
        let gain = SMatrix::<f64, 1, 1>::new(0.04);
        let truth = start::start(
            &gain,
            &SVector::from([10.0]),
            20.0,
            Structure { segments, stops: 2 },
        );
        let operator = Stops::<1>::prepare(&truth).unwrap();
        let mut state = operator.begin(&SVector::from([wander(0.0)[0]]));
        let mut noise = noise(8);
        let recording = one_motor(rows, |time| {
            let count = wander(time)[0];
            operator.advance(&mut state, &SVector::from([count]));
            (count, operator.bend(&state)[0] + 0.02 * noise())
        });
        let structures = [1, 2]
            .map(|segments| Structure { segments, stops: 2 })
            .to_vec();
        fit_stop(
            &whole(&recording),
            &StopOptions {
                structures,
                ..short()
            },
            &Silent,
        )
        .unwrap()
    };
    let (one, two) = (of(1, 900), of(2, 900));
    assert_eq!(
        (one.reading.segments, two.reading.segments),
        (1, 2),
        "{:?} {:?}",
        one.tried,
        two.tried
    );
    assert!(two.tried[1].1 < 0.7 * two.tried[0].1, "{:?}", two.tried);
}

#[test]
fn what_shows_no_hysteresis_is_refused_or_doubted() {
    let ramp = recording(300, |time| {
        (
            [10.0 * time, (3.0 * time).sin() * 200.0],
            [0.2 * time, (3.0 * time).sin()],
        )
    });
    assert!(matches!(
        fit_stop(&whole(&ramp), &short(), &Silent),
        Err(StopError::FewReversals(Finding::FewReversals {
            motor: 0,
            reversals: 0
        }))
    ));
    let mut noise = noise(5);
    let straight = recording(600, |time| {
        let counts = wander(time);
        (
            counts,
            crate::testing::straight(counts).map(|angle| angle + 0.4 * noise()),
        )
    });
    let fit = fit_stop(&whole(&straight), &short(), &Silent).unwrap();
    assert!(
        matches!(fit.warnings[..], [StopWarning::LittleGain { .. }]),
        "{} {}",
        fit.rms,
        fit.linear_rms
    );
}

#[test]
fn options_and_recordings_that_make_no_sense_are_refused() {
    let series = whole(&two_axes(100, 0.0));
    let too_long = Structure {
        segments: 4,
        stops: 1,
    };
    for structures in [
        vec![],
        vec![one_segment(0)],
        vec![one_segment(3), one_segment(6)],
        vec![too_long],
    ] {
        let options = StopOptions {
            structures,
            ..short()
        };
        assert!(matches!(
            fit_stop(&series, &options, &Silent),
            Err(StopError::Structures { .. })
        ));
    }
    assert!(matches!(
        fit_stop(&series, &short(), &Silent),
        Err(StopError::FewSamples { .. })
    ));
}
