//! Derivatives compared with differences.

use super::super::{BalanceMotor, BalanceStop};
use super::*;
use crate::model::families::hysteresis::Operator;

/// Two motors with gap, slack, all stops and an asymmetry.
fn balance() -> BalanceParameters {
    let motor = BalanceMotor {
        centre_counts: 10.0,
        travel_per_count: 1.5,
        neutral: 12.0,
        gap: 14.0,
        coupling: 0.06,
        preload: [-12.0, 9.0],
        preload_growth: 11.0,
        stiffness: [1.1, 0.9],
        spring: 0.16,
        hardening: 0.1,
        friction: 18.0,
        friction_by_tension: [0.2, 0.15],
        friction_by_other: 0.02,
        friction_growth: [0.2, 0.1],
        friction_slope: 0.05,
        friction_asymmetry: 0.1,
        preload_growth_by_other: 7.0,
        hardening_by_other: 0.2,
        transmission_error: [5.0, -4.0, 2.0, 1.0],
    };
    let stop = |stiffness, share| BalanceStop { stiffness, share, yields: stiffness == 3.0 };
    BalanceParameters {
        motors: vec![motor.clone(), BalanceMotor { gap: 5.0, coupling: -0.04, ..motor }],
        own_stops: [(10.0, 0.2), (4.0, 0.3), (1.6, 0.2), (0.6, 0.2), (0.25, 0.1), (3.0, 0.3)]
            .map(|(stiffness, share)| stop(stiffness, share))
            .to_vec(),
        shared_stops: vec![stop(3.0, 0.2), stop(1.5, 0.1), stop(0.5, 0.1)],
        shared_growth: 0.3,
        creep: [0.05, 0.03, 0.04],
        counts_per_turn: 1024.0,
        loose_stiffness: 0.05,
        softness: 8.0,
        friction_stays: 0.4,
    }
}

/// Time per path step, s: between the times of the elements.
const STEP_S: f64 = 0.2;

fn bend<const D: usize>(
    file: &BalanceParameters,
    path: &[SVector<f64, D>],
    step_s: f64,
) -> SVector<f64, D> {
    let operator = ForceBalance::<D>::prepare(file).unwrap();
    let mut state = operator.begin(&path[0]);
    path.iter().for_each(|counts| operator.advance_over(&mut state, counts, step_s));
    operator.bend(&state)
}

fn check<const D: usize>(file: &BalanceParameters) {
    let path: Vec<SVector<f64, D>> = (0..300)
        .map(|step| {
            let time = 0.05 * f64::from(step);
            SVector::from_fn(|i, _| 400.0 * (time + 0.7 * time * i as f64).sin())
        })
        .collect();
    let operator = ForceBalance::<D>::prepare(file).unwrap();
    let mut at = operator.begin_sensitive(&path[0]);
    path.iter().for_each(|counts| operator.advance_sensitive(&mut at, counts, STEP_S));
    assert!((at.bend() - bend(file, &path, STEP_S)).amax() < 1e-9);
    let numbers = file.numbers();
    for number in 0..NUMBERS {
        // Smaller than the way to the next corner of a stop.
        let by = 1e-6 * (1.0 + numbers[number].abs());
        let moved = |by: f64| {
            let mut moved = numbers;
            moved[number] += by;
            bend(&with_numbers(file, &moved), &path, STEP_S)
        };
        let found = (moved(by) - moved(-by)) / (2.0 * by);
        for i in 0..D {
            let slope = at.slopes()[i][number];
            let error = (found[i] - slope).abs();
            assert!(error < 1e-3 * (1.0 + slope.abs()), "{number}: {slope}, {}", found[i]);
        }
    }
}

/// The inverse of [`BalanceParameters::numbers`].
fn with_numbers(file: &BalanceParameters, numbers: &Slopes) -> BalanceParameters {
    let mut file = file.clone();
    file.each_number(|place, value| *value = numbers[place]);
    file
}

#[test]
fn the_slopes_are_the_derivatives_of_the_bend() {
    check::<2>(&balance());
    let mut one = balance();
    one.motors.truncate(1);
    one.shared_stops.clear();
    check::<1>(&one);
}

/// A fit goes in long steps, the robot in those of a tick.
#[test]
fn long_steps_end_where_short_ones_do() {
    let turns = [[0.0; 2], [420.0, 100.0], [-380.0, 300.0], [150.0, -350.0], [-60.0, -20.0]];
    let after = |step: f64| {
        let mut path = vec![SVector::from(turns[0])];
        for pair in turns.windows(2) {
            let [from, to] = [pair[0], pair[1]].map(SVector::from);
            let steps = ((to - from).amax() / step).ceil() as u32;
            let at = |k: u32| from + (to - from) * (f64::from(k) / f64::from(steps));
            path.extend((1..=steps).map(at));
        }
        bend::<2>(&balance(), &path, step / 200.0)
    };
    let apart = (after(40.0) - after(2.0)).amax();
    // Limits from before the step leave 1.2.
    assert!(apart < 0.5, "{apart}");
}
