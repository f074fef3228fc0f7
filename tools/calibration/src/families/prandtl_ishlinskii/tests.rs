//! Tests of the fit of generalised play operators.

use i2ris::model::hysteresis::prandtl_ishlinskii::MAX_PLAYS;

use super::operator_fit::{OperatorFit, ShapeKind, fit_operator};
use crate::families::chain::ChainOptions;
use crate::families::play_error::PlayError;
use crate::progress::Silent;
use crate::recording::Recording;
use crate::series::Series;
use crate::testing::{few_starts, noise, one_motor, recording, straight, wander};

const NOISE: f64 = 0.03;

fn fit(recording: &Recording, shape: ShapeKind) -> Result<OperatorFit, PlayError> {
    let options = ChainOptions { components: Some(1), residual: false, em: few_starts(2) };
    fit_operator(&Series::whole(recording), shape, &options, &Silent)
}

/// A snake whose motors act through a play each; `input` makes the input of a play of the counts,
/// `half_width` its width.
fn snake(input: impl Fn([f64; 2], usize) -> f64, half_width: impl Fn(f64) -> f64) -> Recording {
    let mut random = noise(5);
    let mut behind: Option<[f64; 2]> = None;
    recording(3000, |time| {
        let counts = wander(time);
        let inputs = [0, 1].map(|motor| input(counts, motor));
        let old = behind.unwrap_or(inputs);
        let moved = [0, 1].map(|motor| {
            let half_width = half_width(inputs[motor]);
            f64::clamp(old[motor], inputs[motor] - half_width, inputs[motor] + half_width)
        });
        behind = Some(moved);
        let bend = [0, 1].map(|motor| 0.3 * counts[motor] + 0.7 * moved[motor]);
        (counts, straight(bend).map(|angle| angle + NOISE * random()))
    })
}

#[test]
fn plays_of_constant_width_take_the_simplest_structure() {
    let plain = snake(|counts, motor| counts[motor], |_| 40.0);
    let found = fit(&plain, ShapeKind::Plane).unwrap();
    assert_eq!(found.structure, "one motor at a time, constant widths");
    assert!(found.left_out_rms < 4.0 * NOISE, "{}", found.left_out_rms);
    let gap = found.mechanism.motors[0].gap_counts;
    assert!((50.0..110.0).contains(&gap), "{gap} instead of 80 counts");
}

#[test]
fn widths_that_grow_with_the_bend_are_found() {
    let growing = snake(|counts, motor| counts[motor], |input| 10.0 + 0.25 * input.abs());
    let found = fit(&growing, ShapeKind::Plane).unwrap();
    assert!(found.structure.ends_with("changing widths"), "{}", found.structure);
    assert!(found.left_out_rms < 8.0 * NOISE, "{}", found.left_out_rms);
    assert!(found.operator.plays.iter().any(|play| play.growth[0] > 0.05));
    assert!(found.operator.plays.len() <= MAX_PLAYS);
}

#[test]
fn plays_between_the_motors_are_found() {
    let mixed = snake(|counts, motor| counts[motor] + 0.3 * counts[1 - motor], |_| 60.0);
    let found = fit(&mixed, ShapeKind::Plane).unwrap();
    assert!(found.structure.starts_with("directions between the motors"), "{}", found.structure);
    let axes = fit(&mixed, ShapeKind::Separable).unwrap();
    assert!(axes.structure.starts_with("motors that pull on each other"), "{}", axes.structure);
    for play in &axes.operator.plays {
        let [a, b] = [0, 1].map(|motor: usize| play.direction[motor].abs());
        assert!(a.min(b) < 0.2 * a.max(b), "{play:?} is far from the axes");
    }
    assert!(found.left_out_rms < axes.left_out_rms, "{found:?}");
}

#[test]
fn one_motor_is_enough_and_none_is_too_little() {
    let mut random = noise(6);
    let mut behind: f64 = 0.0;
    let one = one_motor(1500, |time| {
        let count = (400.0 * (0.4 * time).sin() + 200.0 * (1.7 * time).sin()).round();
        behind = behind.clamp(count - 30.0, count + 30.0);
        (count, 0.02 * (0.2 * count + 0.8 * behind) + NOISE * random())
    });
    let found = fit(&one, ShapeKind::Plane).unwrap();
    assert!(found.left_out_rms < 3.0 * NOISE, "{}", found.left_out_rms);
    let still = recording(200, |time| {
        let [a, _] = wander(time);
        ([a, 0.001 * a], straight([a, 0.0]))
    });
    let refused = fit(&still, ShapeKind::Plane).unwrap_err();
    assert!(refused.to_string().starts_with("motor 1 hardly moves"), "{refused}");
}
