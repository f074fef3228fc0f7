//! Sample parameters of families, and random ones.

use i2ris::model::file::{FamilyParameters, HullParameters, ModelFile, PolynomialParameters};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::hysteresis::force_balance::{
    BalanceMotor, BalanceParameters, BalanceStop, CREEPING, USUAL_TURN,
};
use i2ris::model::hysteresis::residual::{ResidualParameters, count};
use proptest::collection::vec;
use proptest::prelude::*;

use super::samples::{REACH, file, region};

/// Force balance of a snake with slack, backlash and friction: a typical sample of
/// [`balances`].
pub fn some_balance(motors: usize) -> BalanceParameters {
    balance_of(motors, [6.0, 9.0], [-12.0, -6.0, 15.0, 8.0], [0.2, 0.3])
}

/// Force balance with nearly linear outputs of the given degrees per count.
pub fn balance_family(balance: BalanceParameters, gain: &[Vec<f64>]) -> FamilyParameters {
    let motors = balance.motors.len();
    let curvature = if motors == 1 { &[0.5][..] } else { &[0.5, 0.2, 0.1] };
    let row = |row: &Vec<f64>| {
        let slopes: Vec<f64> = row.iter().map(|gain| 500.0 * gain).collect();
        [&[0.0], slopes.as_slice(), curvature].concat()
    };
    let covariance = |i: usize| (0..gain.len()).map(|j| if i == j { 0.01 } else { 0.0 }).collect();
    FamilyParameters::ForceBalance {
        balance,
        read_out: PolynomialParameters {
            centre_counts: vec![0.0; motors],
            scale_counts: vec![500.0; motors],
            degree: 2,
            coefficients: gain.iter().map(row).collect(),
            covariance: (0..gain.len()).map(covariance).collect(),
        },
        virtual_hull: HullParameters { corners: region(motors, 900.0) },
    }
}

/// A model of [`some_balance`].
pub fn balance_file(motors: usize) -> ModelFile {
    let gain = [[0.024, -0.016], [0.018, 0.022]];
    let gain: Vec<_> = gain[..motors].iter().map(|row| row[..motors].to_vec()).collect();
    file(motors, balance_family(some_balance(motors), &gain), region(motors, 1000.0))
}

fn balance_of(
    motors: usize,
    gap: [f64; 2],
    preload: [f64; 4],
    by_tension: [f64; 2],
) -> BalanceParameters {
    let other = |value: f64| if motors == 1 { 0.0 } else { value };
    let motor = |i: usize| BalanceMotor {
        centre_counts: [15.0, -20.0][i],
        travel_per_count: [0.8, 0.9][i],
        neutral: 4.0,
        gap: gap[i],
        coupling: other(0.05),
        preload: [preload[2 * i], preload[2 * i + 1]],
        preload_growth: 10.0,
        stiffness: [1.1, 0.9],
        spring: 0.15,
        hardening: 0.1,
        friction: 25.0,
        friction_by_tension: [by_tension[i], 0.2],
        friction_by_other: other(0.03),
        friction_growth: [0.2, other(0.1)],
        friction_slope: 0.1,
        friction_asymmetry: -0.1,
        preload_growth_by_other: other(8.0),
        hardening_by_other: other(0.1),
        transmission_error: [3.0, -2.0, 1.0, 0.5],
    };
    let stop = |(stiffness, share)| BalanceStop { stiffness, share, yields: stiffness == 3.0 };
    let shared = [(3.0, 0.2), (1.5, 0.3)].map(stop);
    BalanceParameters {
        motors: (0..motors).map(motor).collect(),
        own_stops: [(10.0, 0.4), (3.0, 0.4), (1.0, 0.2)].map(stop).into(),
        shared_stops: if motors == 1 { Vec::new() } else { shared.into() },
        loose_stiffness: 0.08,
        softness: 8.0,
        friction_stays: 0.3,
        shared_growth: other(0.2),
        creep: [0.0; CREEPING],
        counts_per_turn: USUAL_TURN,
    }
}

/// Force balances of snakes: taut and slack, with and without backlash.
pub fn balances(motors: usize) -> impl Strategy<Value = BalanceParameters> {
    let gap = prop::array::uniform2(0.0..60.0_f64);
    let preload = prop::array::uniform4(-60.0..80.0_f64);
    let by_tension = prop::array::uniform2(0.0..0.6_f64);
    (gap, preload, by_tension)
        .prop_map(move |(gap, preload, by_tension)| balance_of(motors, gap, preload, by_tension))
}

/// Minimum weight of threshold 0 of [`plays`]. Where virtual counts differ by one, counts may
/// differ by its reciprocal.
pub const MIN_WEIGHT: f64 = 0.1;

/// Thresholds and weights of one motor.
fn plays_of_a_motor() -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    (MIN_WEIGHT..1.0_f64, vec((2.0..60.0_f64, 0.0..1.0_f64), 0..5)).prop_map(|(first, others)| {
        let total: f64 = others.iter().map(|(_, weight)| weight).sum::<f64>().max(1e-9);
        let mut thresholds = vec![0.0];
        let mut weights = vec![if others.is_empty() { 1.0 } else { first }];
        for (step, weight) in others {
            thresholds.push(thresholds[thresholds.len() - 1] + step);
            weights.push((1.0 - first) * weight / total);
        }
        let sum: f64 = weights.iter().sum();
        for weight in &mut weights {
            *weight /= sum;
        }
        (thresholds, weights)
    })
}

pub fn plays(motors: usize, planar: usize) -> impl Strategy<Value = PlayParameters> {
    (vec(plays_of_a_motor(), motors), vec(5.0..50.0_f64, 0..=planar)).prop_map(|(each, steps)| {
        let (thresholds_counts, weights) = each.into_iter().unzip();
        let planar_thresholds_counts = steps.iter().scan(0.0, |sum, step| {
            *sum += step;
            Some(*sum)
        });
        PlayParameters {
            thresholds_counts,
            weights,
            planar_thresholds_counts: planar_thresholds_counts.collect::<Vec<f64>>(),
        }
    })
}

/// A residual up to the given degrees that depends on the virtual counts and the lags.
pub fn residual(motors: usize, lags: usize, outputs: usize, size: f64) -> ResidualParameters {
    let features = if motors == 1 { count::<1>(2, 1, lags) } else { count::<2>(2, 1, lags) };
    let coefficient = |i: usize, j: usize| size * (1.7 * i as f64 + 2.3 * j as f64).sin();
    let coefficients =
        (0..outputs).map(|i| (0..features).map(|j| coefficient(i, j)).collect()).collect();
    ResidualParameters { scale_counts: REACH, shape_degree: 2, lag_degree: 1, coefficients }
}
