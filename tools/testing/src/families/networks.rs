//! Sample networks for the tests.

use i2ris::model::file::{FamilyParameters, ModelFile};
use i2ris::model::network::{Activation, Layer, NetworkParameters};

use super::samples::{file, region};

/// Numbers of a network between -`size` and `size`, always the same.
fn weights(height: usize, width: usize, size: f64) -> Vec<Vec<f64>> {
    let number = |i: usize, j: usize| size * (1.7 * i as f64 + 2.9 * j as f64 + 0.4).sin();
    (0..height).map(|i| (0..width).map(|j| number(i, j)).collect()).collect()
}

/// Gates from two inputs for the given units: `open` are the biases of the gates, and the gate
/// `new` depends on one motor.
fn gates(units: usize, open: &[f64], new: usize) -> [Vec<Vec<f64>>; 2] {
    let mut input = weights(open.len() * units, 2, 0.05);
    for (unit, row) in input[new * units..(new + 1) * units].iter_mut().enumerate() {
        *row = vec![0.0, 0.0];
        row[unit % 2] = 0.5;
    }
    [input, weights(open.len() * units, units, 0.1 / units as f64)]
}

fn biases(units: usize, open: &[f64]) -> Vec<f64> {
    open.iter().flat_map(|bias| vec![*bias; units]).collect()
}

/// Averages the units of each motor.
pub fn averages(units: usize) -> Layer {
    let row = |motor: usize| {
        (0..units).map(|unit| if unit % 2 == motor { 4.0 / units as f64 } else { 0.0 }).collect()
    };
    Layer::Dense { weight: vec![row(0), row(1)], bias: vec![0.1; 2], activation: Activation::None }
}

pub fn gru(units: usize) -> Layer {
    let [input_weight, recurrent_weight] = gates(units, &[0.0, -1.5, 0.0], 2);
    let input_bias = biases(units, &[0.0, -1.5, 0.0]);
    let recurrent_bias = vec![0.01; 3 * units];
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
    let [input_weight, recurrent_weight] = gates(units, &[2.0, -1.5, 0.0, 2.0], 2);
    let input_bias = biases(units, &[2.0, -1.5, 0.0, 2.0]);
    let recurrent_bias = vec![0.01; 4 * units];
    Layer::Lstm { input_weight, recurrent_weight, input_bias, recurrent_bias }
}

/// A network of the present and two past steps.
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
