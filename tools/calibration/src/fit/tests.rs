use i2ris::model::file::FamilyParameters;
use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::backlash_play::{PlayParameters, Plays};
use nalgebra::SVector;

use super::*;
use crate::progress::Silent;
use crate::testing::{noise, one_motor, recording, straight, wander};

/// Few restarts: these tests are not about the best of many.
fn options() -> FitOptions {
    FitOptions {
        choice: Choice::One(Family::Gmr),
        components: Components::UpTo(4),
        em: EmOptions {
            restarts: 3,
            ..EmOptions::default()
        },
        ..FitOptions::default()
    }
}

/// A snake that bends less and less, with noise of 0.05 deg.
fn bent(rows: usize) -> Recording {
    let mut random = noise(1);
    recording(rows, |time| {
        let angles =
            straight(wander(time)).map(|angle| 12.0 * (angle / 12.0).tanh() + 0.05 * random());
        (wander(time), angles)
    })
}

/// Both motors on one circle, the angles behind by a phase, as the robot's recording has it.
fn circle() -> Recording {
    let mut random = noise(2);
    recording(250, |time| {
        let phase = 0.5 * time;
        let angles = straight([350.0 * (phase - 0.3).cos(), 350.0 * (phase - 0.3).sin()]);
        let lifted = [
            angles[0] + 2.0 * (3.0 * phase).sin(),
            angles[1] - 1.5 * (2.0 * phase).cos(),
        ];
        (
            [350.0 * phase.cos(), 350.0 * phase.sin()].map(f64::round),
            lifted.map(|angle| angle + 0.2 * random()),
        )
    })
}

fn held_out(model: &Model, output: usize) -> f64 {
    model.file().metrics[output].held_out.unwrap().rmsd
}

#[test]
fn a_mixture_follows_a_bend_that_a_straight_model_cannot() {
    let outcome = fit(&bent(2000), &options(), &Silent).unwrap();
    for output in 0..2 {
        let (gmr, linear) = (
            held_out(&outcome.model, output),
            held_out(&outcome.linear, output),
        );
        assert!(gmr < 0.6 * linear && gmr < 0.4, "{gmr} beside {linear}");
    }
    let chosen = outcome.report.chosen().unwrap();
    assert!(chosen.components > 1);
    assert_eq!(
        outcome.model.file().training.bic,
        chosen.fit.as_ref().map(|fit| fit.bic)
    );
}

#[test]
fn a_straight_snake_is_found_down_to_its_noise() {
    let mut random = noise(3);
    let snake = recording(400, |time| {
        (
            wander(time),
            straight(wander(time)).map(|angle| angle + 0.1 * random()),
        )
    });
    let outcome = fit(
        &snake,
        &FitOptions {
            choice: Choice::One(Family::Linear),
            ..options()
        },
        &Silent,
    )
    .unwrap();
    assert!(outcome.report.candidates.is_empty());
    assert_eq!(outcome.model.id(), outcome.linear.id());
    let FamilyParameters::Linear { gain, .. } = &outcome.model.file().family else {
        panic!("not linear")
    };
    for (gain, expected) in gain.concat().iter().zip([0.02, -0.015, 0.015, 0.02]) {
        assert!(
            (gain - expected).abs() < 1e-4,
            "{gain} instead of {expected}"
        );
    }
    assert!((held_out(&outcome.model, 0) - 0.1).abs() < 0.02);
}

#[test]
fn one_motor_and_one_output_are_enough() {
    let mut random = noise(4);
    let probe = one_motor(300, |time| {
        let count = (600.0 * (0.4 * time).sin()).round();
        (count, 20.0 * (count / 400.0).tanh() + 0.1 * random())
    });
    let outcome = fit(&probe, &options(), &Silent).unwrap();
    assert_eq!((outcome.model.motors(), outcome.model.outputs()), (1, 1));
    assert!(held_out(&outcome.model, 0) < 0.6 * held_out(&outcome.linear, 0));
}

#[test]
fn the_model_file_says_where_it_comes_from() {
    let recording = bent(400);
    let options = FitOptions {
        robot_id: "left".to_owned(),
        hold_out: HoldOut::Fraction(0.3),
        ..options()
    };
    let outcome = fit(&recording, &options, &Silent).unwrap();
    let file = outcome.model.file();
    assert_eq!((file.robot_id.as_str(), file.training.rows), ("left", 280));
    assert_eq!((file.training.seed, file.training.restarts), (1, 3));
    assert_eq!(file.training.data_sha256, recording.sha256());
    assert!(outcome.report.training.iter().all(|row| {
        outcome
            .model
            .hull()
            .contains(&recording.rows()[*row].counts)
    }));
}

#[test]
fn the_same_seed_gives_the_same_model() {
    let recording = bent(400);
    let id = |seed| {
        let options = FitOptions {
            em: EmOptions {
                seed,
                restarts: 2,
                ..EmOptions::default()
            },
            ..options()
        };
        fit(&recording, &options, &Silent).unwrap().model.id()
    };
    assert_eq!(id(5), id(5));
    assert_ne!(id(5), id(6));
}

#[test]
fn without_held_out_rows_there_are_no_held_out_metrics() {
    let outcome = fit(
        &bent(400),
        &FitOptions {
            hold_out: HoldOut::Nothing,
            ..options()
        },
        &Silent,
    )
    .unwrap();
    assert_eq!(outcome.report.training.len(), 400);
    assert!(
        outcome
            .model
            .file()
            .metrics
            .iter()
            .all(|metrics| metrics.held_out.is_none())
    );
}

#[test]
fn spikes_are_tested_but_not_trained_on() {
    let mut random = noise(5);
    let spiky = recording(400, |time| {
        // Row 100 is for training, row 350 is held out.
        let spike = if time == 20.0 || time == 70.0 {
            50.0
        } else {
            0.0
        };
        (
            wander(time),
            straight(wander(time)).map(|angle| angle + spike + 0.1 * random()),
        )
    });
    let outcome = fit(&spiky, &options(), &Silent).unwrap();
    let flagged: Vec<_> = outcome
        .report
        .survey
        .spikes
        .iter()
        .map(|spike| spike.row)
        .collect();
    assert_eq!(flagged, [100, 100, 350, 350]);
    assert!(!outcome.report.training.contains(&100) && outcome.report.training.contains(&99));
    let metrics = &outcome.model.file().metrics[0];
    assert!(metrics.training.max < 2.0 && metrics.held_out.unwrap().max > 45.0);

    let keep = SpikeOptions {
        keep: true,
        ..SpikeOptions::default()
    };
    let kept = fit(
        &spiky,
        &FitOptions {
            spikes: keep,
            choice: Choice::One(Family::Linear),
            ..options()
        },
        &Silent,
    )
    .unwrap();
    assert!(kept.report.training.contains(&100));
}

#[test]
fn a_model_that_cannot_be_inverted_is_surpassed_by_one_that_can() {
    let exactly = FitOptions {
        components: Components::Exactly(8),
        ..options()
    };
    let error = fit(&circle(), &exactly, &Silent).unwrap_err();
    assert!(
        matches!(
            error,
            FitError::Refused {
                family: Family::Gmr,
                ..
            }
        ),
        "{error}"
    );
    assert!(
        error.to_string().contains("the inverse fails at counts"),
        "{error}"
    );

    let up_to = FitOptions {
        components: Components::UpTo(8),
        ..options()
    };
    let outcome = fit(&circle(), &up_to, &Silent).unwrap();
    let chosen = outcome.report.chosen().unwrap();
    assert!(chosen.components < 8);
    let better_but_refused = |c: &&Candidate| matches!(c.verdict, Verdict::Refused(_));
    assert!(
        outcome
            .report
            .candidates
            .iter()
            .any(|c| better_but_refused(&c))
    );
    for candidate in outcome.report.candidates.iter().filter(better_but_refused) {
        assert!(candidate.left_out_rms < chosen.left_out_rms.map(|rms| 1.01 * rms));
    }
}

#[test]
fn what_cannot_be_fitted_is_explained() {
    let refused =
        |recording: &Recording, options: &FitOptions| fit(recording, options, &Silent).unwrap_err();
    let together = recording(100, |time| {
        let [a, _] = wander(time);
        ([a, 2.0 * a + 5.0], straight([a, a]))
    });
    let error = refused(&together, &options());
    assert!(
        error.to_string().contains("the motors move together"),
        "{error}"
    );

    let late = recording(100, |time| {
        let [a, b] = wander(time);
        let counts = [a, if time > 18.0 { b } else { 0.0 }];
        (counts, straight(counts))
    });
    let error = refused(&late, &options());
    assert_eq!(
        error.to_string(),
        LinearError::Still { motor: 1 }.to_string()
    );

    let late = recording(100, |time| {
        (
            wander(time),
            [straight(wander(time))[0], (time - 18.0).max(0.0)],
        )
    });
    let error = refused(&late, &options());
    assert!(
        matches!(&error, FitError::Constant { output } if output == "yaw"),
        "{error}"
    );

    let greedy = FitOptions {
        components: Components::Exactly(60),
        ..options()
    };
    let error = refused(&bent(400), &greedy);
    assert!(
        error
            .to_string()
            .contains("component(s), and 60 are asked for; record more"),
        "{error}"
    );

    let greedy = FitOptions {
        hold_out: HoldOut::Fraction(0.99),
        ..options()
    };
    assert!(matches!(refused(&bent(400), &greedy), FitError::Split(_)));
}

/// One axis at a time: the mixture has never seen the plane between them, and folds there as soon
/// as it has components enough.
#[test]
fn where_a_model_with_memory_has_no_inverse_it_is_fitted_with_fewer_components() {
    let operator = Plays::<2>::prepare(&PlayParameters {
        thresholds_counts: vec![vec![0.0, 60.0]; 2],
        weights: vec![vec![0.4, 0.6]; 2],
        planar_thresholds_counts: Vec::new(),
    })
    .unwrap();
    let mut state = operator.begin(&SVector::zeros());
    let mut random = noise(6);
    let cross = recording(1500, |time| {
        let [a, b] = wander(time);
        let counts = if time < 150.0 { [a, 0.0] } else { [0.0, b] };
        operator.advance(&mut state, &SVector::from(counts));
        let [p, y] = straight(operator.local(&state, &SVector::from(counts)).mean.into());
        (
            counts,
            [
                7.0 * (p / 7.0).tanh() + 0.02 * random(),
                7.0 * ((y - 0.2 * p) / 7.0).tanh() + 0.02 * random(),
            ],
        )
    });
    let options = FitOptions {
        choice: Choice::One(Family::GmrPlay),
        hold_out: HoldOut::Nothing,
        ..options()
    };
    let outcome = fit(&cross, &options, &Silent).unwrap();
    assert_eq!(
        outcome.family,
        Family::GmrPlay,
        "it was not refused for good"
    );
}
