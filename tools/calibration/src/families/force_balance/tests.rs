//! The fit on snakes of its own kind with known parameters.

use i2ris::model::file::FamilyParameters;
use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::force_balance::{CREEPING, ForceBalance, REACH, USUAL_TURN};
use nalgebra::{DMatrix, DVector, SVector};

use super::error::BalanceError;
use super::judge::{SURE, is_better};
use super::latency::RemainingLatency;
use super::layout::{Layout, Terms, Typical};
use super::levenberg_marquardt::LeastSquares;
use super::objective::Objective;
use super::read_out::ReadOut;
use super::search::{BalanceFit, Start, fit_force_balance};
use super::target::Target;
use crate::progress::Silent;
use crate::recording::Recording;
use crate::series::Series;
use crate::testing::{noise, one_motor, recording, straight, wander, with_threads};

fn fit(recording: &Recording) -> Result<BalanceFit, BalanceError> {
    fit_force_balance(&Series::whole(recording), true, Start::Typical, &Silent)
}

fn start(layout: &Layout, [preload, gap, friction]: [f64; 3]) -> DVector<f64> {
    layout.start(&Typical { preload, gap, friction, ..Typical::USUAL })
}

fn snake(rows: usize) -> Recording {
    late(rows, [0.0; CREEPING], 0.0)
}

/// A snake of one motor whose parameters are not those that the search starts from: slack wires,
/// and a gear with play. Half the range of the motor is 750 counts. Its angles are late.
fn late(rows: usize, creep: [f64; CREEPING], late_s: f64) -> Recording {
    let layout = Layout::new(vec![(0.0, REACH / 750.0)], true);
    let mut truth = layout.decode(&start(&layout, [-20.0, 16.0, 30.0]));
    truth.motors[0].friction = 45.0;
    truth.creep = creep;
    let operator = ForceBalance::<1>::prepare(&truth).unwrap();
    let at = |time| SVector::from([wander(time - late_s)[0]]);
    let mut state = operator.begin(&at(0.0));
    let mut noise = noise(3);
    one_motor(rows, |time| {
        operator.advance_over(&mut state, &at(time), 0.2);
        let bend = operator.bend(&state)[0] / REACH;
        (wander(time)[0], 30.0 * bend + 2.0 * bend * bend + 0.02 * noise())
    })
}

#[test]
fn parameters_are_the_same_after_encoding() {
    for (other, transmission, creep) in [(false, None, 2), (true, None, 0), (true, Some(900.0), 3)]
    {
        let terms = Terms { other, transmission, creep };
        let layout = Layout::new(vec![(10.0, 1.5), (-20.0, 2.0)], true).with(terms);
        let mut at = start(&layout, [-20.0, 16.0, 30.0]);
        for (index, number) in at.iter_mut().enumerate() {
            *number += 0.1 * (index as f64 + 1.0).sin();
        }
        let balance = layout.decode(&at);
        assert_eq!(Layout::terms_of(&balance), terms);
        assert!((layout.encode(&balance) - at).amax() < 1e-9);
    }
}

/// The same snake in the units of another calibration: twice the range, and another middle.
#[test]
fn rescaled_parameters_bend_alike() {
    let layout = |half: f64, middle: [f64; 2]| {
        let terms = Terms { other: true, transmission: Some(USUAL_TURN), creep: 3 };
        Layout::new(middle.map(|middle| (middle, REACH / half)).to_vec(), true).with(terms)
    };
    let [narrow, wide] = [layout(500.0, [40.0, -70.0]), layout(1000.0, [0.0; 2])];
    let mut at = start(&narrow, [-20.0, 16.0, 30.0]);
    for (index, number) in at.iter_mut().enumerate() {
        *number += 0.1 * (index as f64 + 1.0).sin();
    }
    let balance = narrow.decode(&at);
    let [narrow, wide] = [balance.clone(), wide.rescaled(&balance)]
        .map(|balance| ForceBalance::<2>::prepare(&balance).unwrap());
    let first = SVector::from(wander(0.0));
    let (mut near, mut far) = (narrow.begin(&first), wide.begin(&first));
    for step in 1..400 {
        let counts = SVector::from(wander(0.2 * f64::from(step)));
        narrow.advance_over(&mut near, &counts, 0.2);
        wide.advance_over(&mut far, &counts, 0.2);
        let apart = narrow.bend(&near) * 0.5 - wide.bend(&far);
        // Half a step of the one is a whole one of the other.
        assert!(apart.amax() < 2.0, "{step}: {apart}");
    }
}

/// Only the noise of 0.02 deg is left, and the deviations of the parameters hold.
#[test]
fn a_snake_of_this_kind_is_explained_to_its_noise() {
    let found = fit(&snake(1200)).unwrap();
    let FamilyParameters::ForceBalance { read_out, .. } = &found.family else {
        panic!("another family")
    };
    let rms = read_out.covariance[0][0].sqrt();
    assert!((0.018..0.021).contains(&rms), "{rms}");
    let motor = found.mechanism.motors[0];
    let per_travel = 750.0 / REACH;
    let truth = [(motor.gap, 32.0), (motor.preload, -20.0), (motor.friction, 45.0)];
    for (measured, truth) in truth {
        let apart = (measured.value - per_travel * truth).abs() / measured.deviation;
        assert!(apart < 4.0, "{measured} instead of {}", per_travel * truth);
        assert!(measured.deviation < 0.2 * per_travel * truth.abs(), "{measured}");
    }
    assert!(!found.mechanism.to_string().contains("usual"));
    let mut loose = found.mechanism.clone();
    loose.motors[0].gap.value = 0.4 * motor.half_range;
    assert!(loose.to_string().contains("40 % of the half range is 20 times what is usual"));
}

/// A pinion that is not round, by half the range and by the turn of the motor, counts.
fn uneven(half_range: f64, turn: f64) -> Recording {
    let layout = Layout::new(vec![(0.0, REACH / half_range)], true);
    let mut truth = layout.decode(&start(&layout, [20.0, 8.0, 20.0]));
    (truth.motors[0].transmission_error, truth.counts_per_turn) = (UNEVEN, turn);
    let operator = ForceBalance::<1>::prepare(&truth).unwrap();
    let at = |time| SVector::from([(half_range / 450.0 * wander(time)[0]).round()]);
    let mut state = operator.begin(&at(0.0));
    let mut noise = noise(4);
    one_motor(1200, |time| {
        operator.advance(&mut state, &at(time));
        (at(time)[0], 30.0 * operator.bend(&state)[0] / REACH + 0.02 * noise())
    })
}

const UNEVEN: [f64; 4] = [6.0, -3.0, 2.0, 0.0];

/// In the last recording it has a turn of 820 counts, of which one of 1024 explains a third.
#[test]
#[ignore = "a minute of fits: for .ci/nightly"]
fn a_transmission_error_is_found_where_there_is_one() {
    let found = |recording: &Recording| match fit(recording).unwrap().family {
        FamilyParameters::ForceBalance { balance, .. } => balance.motors[0].transmission_error,
        other => panic!("{other:?}"),
    };
    let with = found(&uneven(2250.0, USUAL_TURN));
    for (found, truth) in with.iter().zip(UNEVEN) {
        assert!((found - truth).abs() < 1.0, "{with:?}");
    }
    assert_eq!(found(&snake(1200)), [0.0; 4]);
    assert_eq!(found(&uneven(1080.0, 820.0)), [0.0; 4]);
}

/// Elements of 0.5 and 5 s alone, all three, and none.
#[test]
#[ignore = "a minute of fits: for .ci/nightly"]
fn creep_is_found_where_there_is_some() {
    for truth in [[0.08, 0.1, 0.0], [0.08, 0.1, 0.12], [0.0; CREEPING]] {
        let FamilyParameters::ForceBalance { balance, .. } =
            fit(&late(1200, truth, 0.0)).unwrap().family
        else {
            panic!("another family")
        };
        for (found, truth) in balance.creep.iter().zip(truth) {
            assert!((found - truth).abs() <= 0.3 * truth, "{:?} {truth:?}", balance.creep);
        }
    }
}

/// The derivatives that the search uses are those of the residuals.
#[test]
#[ignore = "a minute of fits: for .ci/nightly"]
fn sample_latency_is_separated_from_hysteresis() {
    for late_s in [0.0, 0.04, -0.04] {
        let RemainingLatency { seconds, deviation_s } =
            fit(&late(900, [0.0; CREEPING], late_s)).unwrap().latency.unwrap();
        assert!((seconds - late_s).abs() < 0.008, "{seconds} +- {deviation_s}, not {late_s}");
        assert!(deviation_s < 0.004, "{deviation_s}");
    }
}

#[test]
fn derivatives_are_those_of_the_residuals() {
    let target = Target::<1>::new(&Series::whole(&snake(300)), true);
    let objective = Objective {
        measured: target.measured(),
        target: &target,
        read_out: ReadOut { degree: 3, ridge: 0.01, plane: true, ratio: 0.8 },
        weight: 10.0,
    };
    let at = start(&target.layout, [-15.0, 12.0, 30.0]);
    // What the form of Kaufman leaves out does not change the gradient.
    let gradient = objective.slopes(&at).unwrap().tr_mul(&objective.residuals(&at).unwrap());
    for number in 0..at.len() {
        let moved = |by: f64| {
            let mut aside = at.clone();
            aside[number] += by;
            0.5 * objective.residuals(&aside).unwrap().norm_squared()
        };
        let found = (moved(1e-4) - moved(-1e-4)) / 2e-4;
        let error = (found - gradient[number]).abs();
        assert!(error < 1e-2 * gradient.amax(), "{number}: {found} {}", gradient[number]);
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let recording = snake(300);
    let run = |threads| with_threads(threads, || fit(&recording).unwrap());
    assert_eq!(run(1), run(3));
}

#[test]
fn recordings_without_enough_are_refused() {
    let few = fit(&snake(50)).unwrap_err();
    assert!(matches!(few, BalanceError::FewSamples { .. }), "{few}");
    let rising = one_motor(400, |time| (10.0 * time, 0.1 * time + (0.3 * time).sin()));
    let rising = fit(&rising).unwrap_err();
    assert!(matches!(rising, BalanceError::FewReversals(_)), "{rising}");
    // The encoder of a motor that holds still goes to and fro by a count.
    let still = recording(400, |time| {
        let counts = [wander(time)[0], (40.0 * time).sin().round()];
        (counts, straight(counts))
    });
    let still = fit(&still).unwrap_err();
    assert!(matches!(still, BalanceError::HoldsStill { motor: 1, .. }), "{still}");
}

/// A term that helps on one block alone is none, whatever it does to the mean.
#[test]
fn blocks_decide_together() {
    let before = [1.0; 20];
    let mut one_block = before;
    one_block[7] = 0.1;
    assert!(!is_better([&before, &one_block], SURE, 0.0));
    let mut most = [0.95; 20];
    most[3] = 1.1;
    assert!(is_better([&before, &most], SURE, 0.0) && !is_better([&before, &most], SURE, 0.05));
    assert!(!is_better([&most, &before], SURE, 0.0));
    // The first block, in which the state is not known yet, hides nothing.
    let hidden = |blocks: [f64; 20]| [&[50.0 * blocks[0]], &blocks[1..]].concat();
    let mut most = [0.8; 20];
    most[0] = 0.4;
    assert!(is_better([&hidden(before), &hidden(most)], SURE, 0.05));
}

/// One axis at a time shows only the shape by length, and the asymmetry of motors and outputs.
#[test]
fn what_both_bends_do_together_is_what_each_does() {
    let even = |x: f64, y: f64| {
        let softer = 1.0 / (1.0 + 0.1 * (x * x + 0.5 * y * y)).sqrt();
        [(x - 0.3 * y) * softer, (0.3 * x + 0.6 * y) * softer]
    };
    let asymmetric = |x: f64, y: f64| {
        let (x, y) = (x + 0.06 * x * x, y - 0.04 * y.powi(4));
        let outputs = [0.8 * x - 0.7 * y, 0.6 * x + 0.8 * y];
        [outputs[0] + 0.1 * outputs[0].powi(2), outputs[1] - 0.05 * outputs[1].powi(4)]
    };
    let strokes = (-20..=20).map(|step| 0.05 * f64::from(step));
    let bends: Vec<[f64; 2]> = strokes.flat_map(|at| [[at, 0.0], [0.02, at]]).collect();
    let table = |row: &dyn Fn([f64; 2]) -> [f64; 2], of: &[[f64; 2]]| {
        DMatrix::from_fn(of.len(), 2, |at, column| row(of[at])[column])
    };
    let missed = |shape: &dyn Fn([f64; 2]) -> [f64; 2], ratio: f64, corners: &[[f64; 2]]| {
        let read_out = ReadOut { degree: 6, ridge: 1e-3, plane: false, ratio };
        let ones = DVector::repeat(bends.len(), 1.0);
        let measured = table(shape, &bends);
        let bends = table(&|bend| bend, &bends);
        let found = read_out.coefficients(&bends, &measured, &ones).unwrap();
        let at_corners = read_out.features(&table(&|bend| bend, corners)) * found;
        (at_corners - table(shape, corners)).amax()
    };
    let even = missed(&|[x, y]| even(x, y), 0.5, &[[0.7, 0.7], [-0.7, 0.7], [0.9, -0.4]]);
    // Of an asymmetry nothing is known beyond what each bend has reached alone.
    let inside = [[0.5, 0.5], [-0.5, 0.5], [0.7, -0.3], [-0.2, -0.7]];
    let asymmetric = missed(&|[x, y]| asymmetric(x, y), 1.1, &inside);
    assert!(even < 6e-3 && asymmetric < 1.5e-2, "{even} {asymmetric}");
}
