//! A model file with a drift built in: the same robot, some time later.

use nalgebra::DMatrix;

use super::{BuiltInDrift, FamilyParameters, MixtureParameters, ModelFile};
use crate::model::error::{ModelError, require};
use crate::model::families::hysteresis::residual::ResidualParameters;
use crate::model::families::network::InverseParameters;

/// A drift of the outputs, `y <- y + gain y + zero`, and of the gaps of the motors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FileDrift {
    /// In SI units.
    pub zero: [f64; 2],
    /// Rows: outputs, columns: outputs.
    pub gain: [[f64; 2]; 2],
    /// Growth of the gap of every motor.
    pub gap: [f64; 2],
}

impl FileDrift {
    /// This drift of a model that has another one already.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        let gain = &self.gain;
        let moved = gain.map(|[a, b]| a * first.zero[0] + b * first.zero[1]);
        let entry = |row: usize, column: usize| {
            let product =
                gain[row][0] * first.gain[0][column] + gain[row][1] * first.gain[1][column];
            gain[row][column] + first.gain[row][column] + product
        };
        Self {
            zero: [0, 1].map(|row: usize| self.zero[row] + first.zero[row] + moved[row]),
            gain: [0, 1].map(|row: usize| [0, 1].map(|column: usize| entry(row, column))),
            gap: [0, 1]
                .map(|motor: usize| self.gap[motor] + first.gap[motor] * (1.0 + self.gap[motor])),
        }
    }
}

/// The affine map of the outputs, in units of the file.
struct OutputMap {
    matrix: Vec<Vec<f64>>,
    zero: Vec<f64>,
}

impl ModelFile {
    /// The model with a drift built in. Training record and metrics stay those of the calibration;
    /// `training.software` says that it is not one.
    ///
    /// # Errors
    ///
    /// When the model has more than two outputs, or a kinematic chain shall get another gain.
    pub fn drifted(&self, drift: &FileDrift) -> Result<Self, ModelError> {
        let outputs = self.outputs.len();
        require(
            (1..=2).contains(&outputs),
            || "outputs".to_owned(),
            outputs,
            "a drift is known of one or two outputs",
        )?;
        let si = self.outputs.first().map_or(1.0, |output| output.unit.si());
        let map = OutputMap::new(drift, outputs, si);
        let mut file = self.clone();
        file.built_in = Some(self.with_built_in(drift, si)?);
        if self.built_in.is_none() {
            file.training.software = format!("{}, with a drift built in", self.training.software);
        }
        match &mut file.family {
            FamilyParameters::Linear { gain, offset, covariance } => {
                *gain = map.times(gain);
                *offset = map.apply(offset);
                *covariance = map.around(covariance);
            }
            FamilyParameters::Kinematic { offset, .. } => {
                let is_shift = drift.gain.as_flattened().iter().all(|gain| *gain == 0.0);
                require(
                    is_shift,
                    || "family.offset".to_owned(),
                    format!("{:?}", drift.gain),
                    "a kinematic chain has no gain that could drift",
                )?;
                *offset = map.apply(offset);
            }
            FamilyParameters::Gmr { mixture } | FamilyParameters::GmrDirection { mixture, .. } => {
                map.mixture(mixture);
            }
            FamilyParameters::GmrPlay { plays, mixture, residual, .. } => {
                for (thresholds, gap) in plays.thresholds_counts.iter_mut().zip(drift.gap) {
                    scale(thresholds, 1.0 + gap);
                }
                scale(&mut plays.planar_thresholds_counts, 1.0 + mean(drift));
                map.chain(mixture, residual);
            }
            FamilyParameters::GmrPrandtlIshlinskii { operator, mixture, residual, .. } => {
                for play in &mut operator.plays {
                    let sum: f64 = play.direction.iter().map(|part| part.abs()).sum();
                    let parts = play.direction.iter().zip(drift.gap);
                    let growth: f64 = parts.map(|(part, gap)| part.abs() * gap).sum();
                    play.threshold_counts *= 1.0 + growth / sum;
                }
                map.chain(mixture, residual);
            }
            FamilyParameters::GmrStop { stops, mixture, residual, .. } => {
                for (motor, gap) in stops.motors.iter_mut().zip(drift.gap) {
                    scale(&mut motor.slack, 1.0 + gap);
                    scale(&mut motor.friction, 1.0 + gap);
                    motor.friction = motor.friction.map(|friction| friction.min(1.0));
                }
                stops.base_friction *= 1.0 + mean(drift);
                map.chain(mixture, residual);
            }
            FamilyParameters::ForceBalance { balance, read_out, .. } => {
                for (motor, gap) in balance.motors.iter_mut().zip(drift.gap) {
                    motor.scale_gap(1.0 + gap);
                }
                read_out.coefficients = map.times(&read_out.coefficients);
                for (row, zero) in read_out.coefficients.iter_mut().zip(&map.zero) {
                    row[0] += zero;
                }
                read_out.covariance = map.around(&read_out.covariance);
            }
            FamilyParameters::Network { network, inverse, gain, covariance, .. } => {
                if let Some(inverse) = inverse {
                    map.before(inverse);
                }
                network.output_gain = map.times(&network.output_gain);
                network.output_offset = map.apply(&network.output_offset);
                network.skip_gain = map.times(&network.skip_gain);
                *gain = map.times(gain);
                *covariance = map.around(covariance);
            }
        }
        Ok(file)
    }

    /// The drift that is built in, in SI units.
    #[must_use]
    pub fn built_in_drift(&self) -> Option<FileDrift> {
        let si = self.outputs.first().map_or(1.0, |output| output.unit.si());
        let BuiltInDrift { zero, gain, gap, .. } = self.built_in.as_ref()?;
        Some(FileDrift { zero: zero.map(|zero| si * zero), gain: *gain, gap: *gap })
    }

    /// All of the drift, with one more.
    fn with_built_in(&self, drift: &FileDrift, si: f64) -> Result<BuiltInDrift, ModelError> {
        let all = self.built_in_drift().map_or(*drift, |first| drift.after(&first));
        let base = match &self.built_in {
            Some(built_in) => built_in.base.clone(),
            None => self.id()?.to_string(),
        };
        let FileDrift { zero, gain, gap } = all;
        Ok(BuiltInDrift { base, zero: zero.map(|zero| zero / si), gain, gap })
    }
}

fn scale(values: &mut [f64], factor: f64) {
    for value in values {
        *value *= factor;
    }
}

fn mean(drift: &FileDrift) -> f64 {
    0.5 * (drift.gap[0] + drift.gap[1])
}

impl OutputMap {
    fn new(drift: &FileDrift, outputs: usize, si: f64) -> Self {
        let row = |i: usize| {
            let columns = 0..outputs;
            columns.map(|j| drift.gain[i][j] + if i == j { 1.0 } else { 0.0 }).collect()
        };
        Self {
            matrix: (0..outputs).map(row).collect(),
            zero: drift.zero[..outputs].iter().map(|zero| zero / si).collect(),
        }
    }

    fn apply(&self, outputs: &[f64]) -> Vec<f64> {
        let rows = self.matrix.iter().zip(&self.zero);
        rows.map(|(row, zero)| zero + dot(row, outputs)).collect()
    }

    /// The matrix times rows of outputs.
    fn times(&self, rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
        product(&self.matrix, rows)
    }

    /// The covariance of the mapped outputs.
    fn around(&self, covariance: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.times(&transposed(&self.times(covariance)))
    }

    /// Inputs come first, outputs last.
    fn mixture(&self, mixture: &mut MixtureParameters) {
        for mean in &mut mixture.means {
            let inputs = mean.len() - self.zero.len();
            let outputs = self.apply(&mean[inputs..]);
            mean.truncate(inputs);
            mean.extend(outputs);
        }
        for covariance in &mut mixture.covariances {
            let rows = |matrix: &mut Vec<Vec<f64>>| {
                let inputs = matrix.len() - self.zero.len();
                let outputs = self.times(&matrix[inputs..]);
                matrix.truncate(inputs);
                matrix.extend(outputs);
            };
            rows(covariance);
            *covariance = transposed(covariance);
            rows(covariance);
            *covariance = transposed(covariance);
        }
    }

    /// An inverse that is asked for mapped outputs: it looks at what they were before the map.
    fn before(&self, inverse: &mut InverseParameters) {
        let size = self.zero.len();
        let matrix = DMatrix::from_fn(size, size, |i, j| self.matrix[i][j]);
        // Without an inverse the map is refused with the file.
        let Some(back) = matrix.try_inverse() else { return };
        let rows = |scale: &[f64]| -> Vec<Vec<f64>> {
            (0..size).map(|i| (0..size).map(|j| scale[i] * back[(i, j)]).collect()).collect()
        };
        // The scale goes into the first layer: behind the map it is one of each output no more.
        let scaled = rows(&inverse.input_scale);
        if let Some(first) = inverse.layers.first_mut() {
            for weight in first.input_weights_mut() {
                *weight = product(weight, &scaled);
            }
        }
        inverse.input_scale.fill(1.0);
        inverse.skip_gain = product(&inverse.skip_gain, &rows(&vec![1.0; size]));
        inverse.input_centre = self.apply(&inverse.input_centre);
    }

    fn chain(&self, mixture: &mut MixtureParameters, residual: &mut Option<ResidualParameters>) {
        self.mixture(mixture);
        if let Some(residual) = residual {
            residual.coefficients = self.times(&residual.coefficients);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Of no rows there are none: a matrix that is absent stays so.
fn product(left: &[Vec<f64>], right: &[Vec<f64>]) -> Vec<Vec<f64>> {
    if right.is_empty() {
        return Vec::new();
    }
    let columns = transposed(right);
    let times = |row: &Vec<f64>| columns.iter().map(|column| dot(row, column)).collect();
    left.iter().map(times).collect()
}

fn transposed(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let columns = rows.first().map_or(0, Vec::len);
    let column = |j: usize| rows.iter().map(|row| row[j]).collect();
    (0..columns).map(column).collect()
}
