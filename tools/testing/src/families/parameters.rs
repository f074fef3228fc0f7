//! Sample parameters of families, and random ones; sample networks.

use i2ris::model::file::{FamilyParameters, HullParameters, ModelFile, PolynomialParameters};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::hysteresis::force_balance::{BalanceMotor, BalanceParameters};
use i2ris::model::hysteresis::force_balance::{BalanceStop, CREEPING, USUAL_TURN};
use i2ris::model::hysteresis::residual::{ResidualParameters, count};
use i2ris::model::network::{Activation, Layer, NetworkParameters};
use proptest::collection::vec;
use proptest::prelude::*;

use super::samples::{REACH, file, region};

/// A typical sample of [`balances`]: a snake with slack, backlash and friction.
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

/// Minimum weight of threshold 0 of [`plays`]. Counts may differ by its reciprocal.
pub const MIN_WEIGHT: f64 = 0.1;

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

/// Numbers of a network between -`size` and `size`, always the same.
fn weights(height: usize, width: usize, size: f64) -> Vec<Vec<f64>> {
    let number = |i: usize, j: usize| size * (1.7 * i as f64 + 2.9 * j as f64 + 0.4).sin();
    (0..height).map(|i| (0..width).map(|j| number(i, j)).collect()).collect()
}

/// Weights and biases of gates from two inputs: `open` are biases; gate 2 depends on one motor.
fn gates(units: usize, open: &[f64]) -> ([Vec<Vec<f64>>; 2], [Vec<f64>; 2]) {
    let height = open.len() * units;
    let mut input = weights(height, 2, 0.05);
    for (unit, row) in input[2 * units..3 * units].iter_mut().enumerate() {
        *row = vec![0.0, 0.0];
        row[unit % 2] = 0.5;
    }
    let bias = open.iter().flat_map(|bias| vec![*bias; units]).collect();
    ([input, weights(height, units, 0.1 / units as f64)], [bias, vec![0.01; height]])
}

pub fn averages(units: usize) -> Layer {
    let row = |motor: usize| {
        (0..units).map(|unit| if unit % 2 == motor { 4.0 / units as f64 } else { 0.0 }).collect()
    };
    Layer::Dense { weight: vec![row(0), row(1)], bias: vec![0.1; 2], activation: Activation::None }
}

pub fn gru(units: usize) -> Layer {
    let (weights, [input_bias, recurrent_bias]) = gates(units, &[0.0, -1.5, 0.0]);
    let [input_weight, recurrent_weight] = weights;
    Layer::Gru { input_weight, recurrent_weight, input_bias, recurrent_bias }
}

/// A GRU that outputs the average of each kind of input.
pub fn gru_of(inputs: usize, units: usize) -> Layer {
    let Layer::Gru { recurrent_weight, input_bias, recurrent_bias, .. } = gru(units) else {
        unreachable!()
    };
    let new = |unit: usize, input: usize| if unit % 2 == input % 2 { 0.8 } else { 0.0 };
    let row = |row: usize| {
        let number =
            |input: usize| if row < 2 * units { 0.02 } else { new(row - 2 * units, input) };
        (0..inputs).map(number).collect()
    };
    let input_weight = (0..3 * units).map(row).collect();
    Layer::Gru { input_weight, recurrent_weight, input_bias, recurrent_bias }
}

pub fn lstm(units: usize) -> Layer {
    let (weights, [input_bias, recurrent_bias]) = gates(units, &[2.0, -1.5, 0.0, 2.0]);
    let [input_weight, recurrent_weight] = weights;
    Layer::Lstm { input_weight, recurrent_weight, input_bias, recurrent_bias }
}

pub fn conv(activation: Activation) -> Layer {
    let tap = |size: f64| vec![vec![size, 0.02], vec![-0.03, size], vec![0.5 * size, 0.1]];
    let taps = vec![tap(0.1), tap(0.15), tap(0.4)];
    Layer::Conv { taps, bias: vec![0.05, -0.05, 0.3], dilation: 2, activation }
}

/// A network of two motors and two angles, about 0.02 deg per count.
pub fn network_file(layers: Vec<Layer>) -> ModelFile {
    let network = NetworkParameters {
        step_counts: 10.0,
        input_centre: vec![20.0, -30.0],
        input_scale: vec![0.001; 2],
        layers,
        output_gain: vec![vec![20.0, 5.0], vec![-5.0, 20.0]],
        output_offset: vec![0.5, -0.25],
        skip_gain: vec![vec![0.001, 0.002], vec![0.0, 0.001]],
    };
    let gain = vec![vec![0.02, 0.005], vec![-0.005, 0.02]];
    let family = FamilyParameters::Network {
        network,
        memory_counts: vec![200.0; 2],
        gain: gain.clone(),
        covariance: vec![vec![0.01, 0.0], vec![0.0, 0.02]],
    };
    let mut file = file(2, family, region(2, 1000.0));
    file.training.linear_gain = Some(gain);
    file
}
