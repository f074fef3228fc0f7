//! Prepared layers, their arithmetic and their hidden state, in arrays of fixed size.

use serde::{Deserialize, Serialize};

use super::parameters::{Activation, Layer, MAX_STATE, MAX_WIDTH};
use crate::units::MotorVec;

/// Numbers per row: the largest array that serialisation supports.
const ROW: usize = 32;

/// The hidden states of all layers with their recurrent parts, and where the last step ended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct NetworkState {
    pub(super) position: MotorVec,
    rows: [[f64; ROW]; MAX_STATE / ROW],
}

impl NetworkState {
    /// Nothing but zeros.
    pub(super) fn at(position: MotorVec) -> Self {
        Self { position, rows: [[0.0; ROW]; MAX_STATE / ROW] }
    }

    pub(super) fn values(&self) -> &[f64] {
        self.rows.as_flattened()
    }

    pub(super) fn values_mut(&mut self) -> &mut [f64] {
        self.rows.as_flattened_mut()
    }
}

/// The most sums of a layer: four gates.
const MAX_SUMS: usize = 4 * MAX_WIDTH;

/// Values of a layer, and their derivatives by T inputs of the network.
#[derive(Debug, Clone, Copy)]
pub(super) struct Signal<const T: usize> {
    pub values: [f64; MAX_WIDTH],
    pub slopes: [[f64; MAX_WIDTH]; T],
}

impl<const T: usize> Signal<T> {
    pub(super) fn zero() -> Self {
        Self { values: [0.0; MAX_WIDTH], slopes: [[0.0; MAX_WIDTH]; T] }
    }
}

/// A layer, and which part of the state is its own.
#[derive(Debug, Clone)]
pub(super) struct PreparedLayer {
    pub units: usize,
    inputs: usize,
    state: std::ops::Range<usize>,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    Dense { weight: Matrix, bias: Vec<f64>, activation: Activation },
    Gru(Recurrent),
    Lstm(Recurrent),
    Conv { taps: Vec<Matrix>, bias: Vec<f64>, dilation: usize, activation: Activation },
}

/// Weights of gates.
#[derive(Debug, Clone)]
struct Recurrent {
    input: Matrix,
    input_bias: Vec<f64>,
    recurrent: Matrix,
    recurrent_bias: Vec<f64>,
}

impl PreparedLayer {
    /// Creates the runtime form of a checked layer; its part of the state begins at `begin`.
    pub(super) fn new(layer: &Layer, inputs: usize, begin: usize) -> Self {
        let (units, kept) = layer.sizes(inputs);
        let kind = match layer {
            Layer::Dense { weight, bias, activation } => Kind::Dense {
                weight: Matrix::new(weight),
                bias: bias.clone(),
                activation: *activation,
            },
            Layer::Gru { input_weight, recurrent_weight, input_bias, recurrent_bias }
            | Layer::Lstm { input_weight, recurrent_weight, input_bias, recurrent_bias } => {
                let recurrent = Recurrent {
                    input: Matrix::new(input_weight),
                    input_bias: input_bias.clone(),
                    recurrent: Matrix::new(recurrent_weight),
                    recurrent_bias: recurrent_bias.clone(),
                };
                let is_gru = matches!(layer, Layer::Gru { .. });
                if is_gru { Kind::Gru(recurrent) } else { Kind::Lstm(recurrent) }
            }
            Layer::Conv { taps, bias, dilation, activation } => Kind::Conv {
                taps: taps.iter().map(|rows| Matrix::new(rows)).collect(),
                bias: bias.clone(),
                dilation: *dilation,
                activation: *activation,
            },
        };
        Self { units, inputs, state: begin..begin + kept, kind }
    }

    /// Where the part of the next layer begins.
    pub(super) fn end(&self) -> usize {
        self.state.end
    }

    /// The values at an input, after the steps that the state has seen.
    pub(super) fn evaluate<const T: usize>(&self, input: &Signal<T>, state: &[f64]) -> Signal<T> {
        let state = state.get(self.state.clone()).unwrap_or_default();
        match &self.kind {
            Kind::Dense { weight, bias, activation } => {
                self.weighted(weight, bias, *activation, input)
            }
            Kind::Conv { taps, activation, .. } => {
                let sums = &state[..self.units];
                taps.last().map_or_else(Signal::zero, |present| {
                    self.weighted(present, sums, *activation, input)
                })
            }
            Kind::Gru(weights) => self.gru(weights, input, state),
            Kind::Lstm(weights) => self.lstm(weights, input, state).0,
        }
    }

    pub(super) fn step(&self, input: &Signal<0>, state: &mut [f64]) -> Signal<0> {
        let output = self.evaluate(input, state);
        let own = state.get_mut(self.state.clone()).unwrap_or_default();
        match &self.kind {
            Kind::Dense { .. } => {}
            Kind::Gru(_) => {
                own[3 * self.units..].copy_from_slice(&output.values[..self.units]);
            }
            Kind::Lstm(weights) => {
                let cells = self.lstm(weights, input, own).1;
                let (hidden, kept) = own[4 * self.units..].split_at_mut(self.units);
                hidden.copy_from_slice(&output.values[..self.units]);
                kept.copy_from_slice(&cells[..self.units]);
            }
            Kind::Conv { .. } => {
                let history = &mut own[self.units..];
                if history.len() >= self.inputs {
                    history.copy_within(..history.len() - self.inputs, self.inputs);
                    history[..self.inputs].copy_from_slice(&input.values[..self.inputs]);
                }
            }
        }
        self.prepare(state);
        output
    }

    /// Computes the recurrent part from the hidden state.
    pub(super) fn prepare(&self, state: &mut [f64]) {
        let own = state.get_mut(self.state.clone()).unwrap_or_default();
        match &self.kind {
            Kind::Dense { .. } => {}
            Kind::Gru(weights) | Kind::Lstm(weights) => {
                let (sums, hidden) = own.split_at_mut(weights.recurrent_bias.len());
                sums.copy_from_slice(&weights.recurrent_bias);
                weights.recurrent.add_product(&hidden[..self.units], sums);
            }
            Kind::Conv { taps, bias, dilation, .. } => {
                let (sums, history) = own.split_at_mut(self.units);
                sums.copy_from_slice(bias);
                for (back, tap) in taps.iter().rev().enumerate().skip(1) {
                    let begin = (back * dilation - 1) * self.inputs;
                    tap.add_product(&history[begin..begin + self.inputs], sums);
                }
            }
        }
    }

    fn weighted<const T: usize>(
        &self,
        weight: &Matrix,
        sums: &[f64],
        activation: Activation,
        input: &Signal<T>,
    ) -> Signal<T> {
        let mut output = Signal::zero();
        let values = &mut output.values[..self.units];
        values.copy_from_slice(sums);
        weight.add_product(&input.values[..self.inputs], values);
        activation.apply(values);
        for (slopes, input) in output.slopes.iter_mut().zip(&input.slopes) {
            weight.add_product(&input[..self.inputs], &mut slopes[..self.units]);
            for (slope, value) in slopes.iter_mut().zip(&output.values).take(self.units) {
                *slope *= activation.slope(*value);
            }
        }
        output
    }

    /// Sums of the gates from the input, and their slopes.
    fn gates<const T: usize>(
        &self,
        weights: &Recurrent,
        input: &Signal<T>,
    ) -> ([f64; MAX_SUMS], [[f64; MAX_SUMS]; T]) {
        let (mut sums, mut slopes) = ([0.0; MAX_SUMS], [[0.0; MAX_SUMS]; T]);
        let count = weights.input_bias.len();
        sums[..count].copy_from_slice(&weights.input_bias);
        weights.input.add_product(&input.values[..self.inputs], &mut sums[..count]);
        for (slopes, input) in slopes.iter_mut().zip(&input.slopes) {
            weights.input.add_product(&input[..self.inputs], &mut slopes[..count]);
        }
        (sums, slopes)
    }

    fn gru<const T: usize>(
        &self,
        weights: &Recurrent,
        input: &Signal<T>,
        state: &[f64],
    ) -> Signal<T> {
        let units = self.units;
        let (recurrent, hidden) = state.split_at(3 * units);
        let (mut sums, slopes) = self.gates(weights, input);
        let (gates, new) = sums[..3 * units].split_at_mut(2 * units);
        add(gates, recurrent);
        Activation::Sigmoid.apply(gates);
        let recurrent_new = &recurrent[2 * units..];
        for ((new, reset), recurrent) in new.iter_mut().zip(&*gates).zip(recurrent_new) {
            *new += reset * recurrent;
        }
        Activation::Tanh.apply(new);
        let mut output = Signal::zero();
        let update = gates[units..].iter();
        let values = output.values.iter_mut().zip(hidden).zip(update).zip(&*new);
        for (((value, hidden), update), new) in values {
            *value = new + update * (hidden - new);
        }
        let at = GruUnits { gates, new, hidden, recurrent_new };
        for (output, slopes) in output.slopes.iter_mut().zip(&slopes) {
            at.slopes(&mut output[..units], slopes);
        }
        output
    }

    /// Values and cells.
    fn lstm<const T: usize>(
        &self,
        weights: &Recurrent,
        input: &Signal<T>,
        state: &[f64],
    ) -> (Signal<T>, [f64; MAX_WIDTH]) {
        let units = self.units;
        let (recurrent, hidden_and_cells) = state.split_at(4 * units);
        let (mut sums, slopes) = self.gates(weights, input);
        add(&mut sums, recurrent);
        Activation::Sigmoid.apply(&mut sums[..2 * units]);
        Activation::Tanh.apply(&mut sums[2 * units..3 * units]);
        Activation::Sigmoid.apply(&mut sums[3 * units..4 * units]);
        let gate = |index: usize, unit: usize| sums[index * units + unit];
        let before = &hidden_and_cells[units..];
        let (mut output, mut cells) = (Signal::zero(), [0.0; MAX_WIDTH]);
        for (unit, cell) in cells[..units].iter_mut().enumerate() {
            *cell = gate(1, unit) * before[unit] + gate(0, unit) * gate(2, unit);
        }
        let mut shown = cells;
        Activation::Tanh.apply(&mut shown[..units]);
        for unit in 0..units {
            let (take, keep, new) = (gate(0, unit), gate(1, unit), gate(2, unit));
            let (show, shown) = (gate(3, unit), shown[unit]);
            output.values[unit] = show * shown;
            for (output, slopes) in output.slopes.iter_mut().zip(&slopes) {
                let slope = |index: usize| slopes[index * units + unit];
                let cell_slope = keep * (1.0 - keep) * slope(1) * before[unit]
                    + take * (1.0 - take) * slope(0) * new
                    + take * (1.0 - new * new) * slope(2);
                output[unit] = show * (1.0 - show) * slope(3) * shown
                    + show * (1.0 - shown * shown) * cell_slope;
            }
        }
        (output, cells)
    }
}

/// Units of a GRU. `gates`: reset, then update.
struct GruUnits<'a> {
    gates: &'a [f64],
    new: &'a [f64],
    hidden: &'a [f64],
    recurrent_new: &'a [f64],
}

impl GruUnits<'_> {
    /// Slopes of the units from those of their sums.
    fn slopes(&self, output: &mut [f64], sums: &[f64]) {
        let units = output.len();
        let (reset, update) = (&self.gates[..units], &self.gates[units..2 * units]);
        let (sums, update_sums) = sums.split_at(units);
        let (update_sums, new_sums) = update_sums.split_at(units);
        let (new_sums, new) = (&new_sums[..units], &self.new[..units]);
        let (hidden, recurrent_new) = (&self.hidden[..units], &self.recurrent_new[..units]);
        for unit in 0..units {
            let reset_slope = reset[unit] * (1.0 - reset[unit]) * sums[unit];
            let update_slope = update[unit] * (1.0 - update[unit]) * update_sums[unit];
            let sum_slope = new_sums[unit] + reset_slope * recurrent_new[unit];
            let new_slope = (1.0 - new[unit] * new[unit]) * sum_slope;
            output[unit] =
                (1.0 - update[unit]) * new_slope + update_slope * (hidden[unit] - new[unit]);
        }
    }
}

fn add(sums: &mut [f64], others: &[f64]) {
    for (sum, other) in sums.iter_mut().zip(others) {
        *sum += other;
    }
}

/// Weights of a layer, by columns: a product adds one column after the other, so that the order of
/// every sum is fixed, and the compiler works on several sums at once.
#[derive(Debug, Clone)]
pub(super) struct Matrix(Vec<f64>);

impl Matrix {
    /// Creates a matrix from rows of equal length.
    pub(super) fn new(rows: &[Vec<f64>]) -> Self {
        let width = rows.first().map_or(0, Vec::len);
        Self((0..width).flat_map(|column| rows.iter().map(move |row| row[column])).collect())
    }

    /// Adds the product with as many inputs as columns to as many sums as rows.
    fn add_product(&self, inputs: &[f64], sums: &mut [f64]) {
        for (column, input) in self.0.chunks_exact(sums.len()).zip(inputs) {
            for (sum, weight) in sums.iter_mut().zip(column) {
                *sum += weight * input;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_have_the_bits_of_sums_in_their_order() {
        for (height, width) in [(8, 2), (13, 7), (192, 64), (64, 4), (2, 64), (1, 1)] {
            let number = |i: usize, j: usize| (1.7 * i as f64 + 2.9 * j as f64 + 0.4).sin();
            let row = |i: usize| (0..width).map(|j| number(i, j)).collect::<Vec<f64>>();
            let rows: Vec<Vec<f64>> = (0..height).map(row).collect();
            let inputs: Vec<f64> = (0..width).map(|j| (0.7 * j as f64).cos()).collect();
            let mut found = vec![0.125; height];
            Matrix::new(&rows).add_product(&inputs, &mut found);
            let in_order = |row: &Vec<f64>| {
                row.iter().zip(&inputs).fold(0.125, |sum, (weight, input)| sum + weight * input)
            };
            assert_eq!(found, rows.iter().map(in_order).collect::<Vec<f64>>(), "{height} {width}");
        }
    }
}
