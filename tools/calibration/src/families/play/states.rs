//! The states of the plays at every sample, for one choice of thresholds.

use std::ops::Range;

use i2ris::model::ModelError;
use i2ris::units::MotorVec;
use nalgebra::{DMatrix, DVector};

use super::super::operator_trace::{TracePoint, UnknownMemory, feature_matrix, trace_plays};
use super::thresholds::Thresholds;
use crate::series::Series;

/// The plays at every sample. Counts are divided by `scale`.
#[derive(Debug, Clone)]
pub(super) struct PlayStates {
    /// Trace points with counts as virtual counts.
    points: Vec<TracePoint>,
    /// Per motor: a row per sample, a column per threshold.
    pub plays: Vec<DMatrix<f64>>,
    /// A row per sample.
    pub outputs: DMatrix<f64>,
    /// The largest count.
    pub scale: f64,
}

impl PlayStates {
    /// Runs the plays along the path. Samples before their memory is known are left out, as in the
    /// fit of the chain.
    pub fn new(series: &Series, thresholds: &Thresholds) -> Result<Self, ModelError> {
        let points = trace_plays(series, &thresholds.idle(), UnknownMemory::LeaveOut)?;
        let counts = points.iter().flat_map(|point| point.virtual_counts);
        let scale = counts.fold(1.0, |most: f64, count| most.max(count.abs()));
        let mut first = 0;
        let mut plays = Vec::new();
        for (motor, thresholds) in thresholds.motors.iter().enumerate() {
            let lag = |row: usize, play: usize| match play {
                0 => 0.0,
                _ => points[row].lags.as_slice()[first + play - 1] * thresholds[play],
            };
            plays.push(DMatrix::from_fn(points.len(), thresholds.len(), |row, play| {
                (points[row].virtual_counts[motor] - lag(row, play)) / scale
            }));
            first += thresholds.len() - 1;
        }
        let output = |row: usize, output: usize| points[row].outputs[output];
        let outputs = DMatrix::from_fn(points.len(), series.outputs(), output);
        Ok(Self { points, plays, outputs, scale })
    }

    pub fn rows(&self) -> usize {
        self.points.len()
    }

    pub fn select(&self, rows: &[usize]) -> Self {
        Self {
            points: rows.iter().map(|row| self.points[*row]).collect(),
            plays: self.plays.iter().map(|plays| plays.select_rows(rows)).collect(),
            outputs: self.outputs.select_rows(rows),
            scale: self.scale,
        }
    }

    /// The last `last` samples, thinned evenly to at most `most`.
    pub fn thinned(&self, last: usize, most: usize) -> Self {
        let step = last.div_ceil(most).max(1);
        let rows = (self.rows().saturating_sub(last)..self.rows()).step_by(step);
        self.select(&rows.collect::<Vec<_>>())
    }

    /// Splits off a block of samples: the rest, and the block.
    pub fn split(&self, block: &Range<usize>) -> (Self, Self) {
        let (unseen, seen): (Vec<usize>, Vec<usize>) =
            (0..self.rows()).partition(|row| block.contains(row));
        (self.select(&seen), self.select(&unseen))
    }

    /// Virtual counts, scaled: a row per sample, a column per motor.
    pub fn virtual_counts(&self, weights: &[DVector<f64>]) -> DMatrix<f64> {
        let columns = self.plays.iter().zip(weights);
        let columns: Vec<_> = columns.map(|(plays, weights)| plays * weights).collect();
        DMatrix::from_columns(&columns)
    }

    /// Features of a residual on all lags: a shape, and lags times a shape, of the given degrees.
    pub fn features(&self, weights: &[DVector<f64>], degrees: (usize, usize)) -> DMatrix<f64> {
        let lags = self.points.first().map_or(0, |point| point.lags.as_slice().len());
        let scaled = motor_vectors(&self.virtual_counts(weights));
        let row = |row: usize| (scaled[row], self.points[row].lags);
        feature_matrix(self.plays.len(), (self.rows(), lags), degrees, &row)
    }
}

/// The rows of a matrix with a column per motor.
pub(super) fn motor_vectors(matrix: &DMatrix<f64>) -> Vec<MotorVec> {
    let row = |row: usize| {
        std::array::from_fn(|motor| matrix.row(row).get(motor).copied().unwrap_or_default())
    };
    (0..matrix.nrows()).map(row).collect()
}
