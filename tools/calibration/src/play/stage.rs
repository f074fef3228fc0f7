//! Where the plays stand at every sample, for one choice of thresholds.

use std::ops::Range;

use i2ris::model::ModelError;
use i2ris::model::hysteresis::backlash_play::{PlayParameters, Plays};
use i2ris::model::hysteresis::residual::{count, features};
use nalgebra::{DMatrix, DVector};

use crate::series::{Point, Series};

/// Thresholds of the plays of all motors, and of the planar plays, counts.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Thresholds {
    /// Per motor, rising from 0.
    pub motors: Vec<Vec<f64>>,
    /// Rising from above 0; none for one motor.
    pub planar: Vec<f64>,
}

impl Thresholds {
    pub fn with(&self, weights: &[DVector<f64>]) -> PlayParameters {
        PlayParameters {
            thresholds_counts: self.motors.clone(),
            weights: weights
                .iter()
                .map(|weights| weights.iter().copied().collect())
                .collect(),
            planar_thresholds_counts: self.planar.clone(),
        }
    }
}

/// The plays at every sample. Counts are divided by `scale`.
#[derive(Debug, Clone)]
pub(super) struct Stage<const D: usize> {
    /// With the counts for virtual counts.
    points: Vec<Point<D>>,
    /// Per motor: a row per sample, a column per threshold.
    pub plays: Vec<DMatrix<f64>>,
    /// A row per sample.
    pub outputs: DMatrix<f64>,
    /// The largest count.
    pub scale: f64,
}

impl<const D: usize> Stage<D> {
    /// Runs the plays along the path. Samples before their memory is known are left out, as in the
    /// fit of the chain.
    pub fn new(series: &Series, thresholds: &Thresholds) -> Result<Self, ModelError> {
        // With all weight on the threshold 0, virtual counts are counts.
        let idle: Vec<_> = thresholds
            .motors
            .iter()
            .map(|motor| unit(motor.len()))
            .collect();
        let points = series.trace(&Plays::<D>::prepare(&thresholds.with(&idle))?);
        let scale = points
            .iter()
            .map(|point| point.virtual_counts.amax())
            .fold(1.0, f64::max);
        let outputs = DMatrix::from_fn(points.len(), series.outputs(), |row, output| {
            points[row].outputs[output]
        });
        let mut first = 0;
        let mut plays = Vec::with_capacity(D);
        for (motor, thresholds) in thresholds.motors.iter().enumerate() {
            let lag = |row: usize, play: usize| match play {
                0 => 0.0,
                _ => points[row].lags.as_slice()[first + play - 1] * thresholds[play],
            };
            let output = |row: usize, play: usize| {
                (points[row].virtual_counts[motor] - lag(row, play)) / scale
            };
            plays.push(DMatrix::from_fn(points.len(), thresholds.len(), output));
            first += thresholds.len() - 1;
        }
        Ok(Self {
            points,
            plays,
            outputs,
            scale,
        })
    }

    pub fn rows(&self) -> usize {
        self.points.len()
    }

    /// Some of the samples.
    pub fn select(&self, rows: &[usize]) -> Self {
        Self {
            points: rows.iter().map(|row| self.points[*row]).collect(),
            plays: self
                .plays
                .iter()
                .map(|plays| plays.select_rows(rows))
                .collect(),
            outputs: self.outputs.select_rows(rows),
            scale: self.scale,
        }
    }

    /// The last samples, so many of them, and of those evenly spaced ones, not more than `most`.
    pub fn thinned(&self, last: usize, most: usize) -> Self {
        let step = last.div_ceil(most).max(1);
        self.select(
            &(self.rows().saturating_sub(last)..self.rows())
                .step_by(step)
                .collect::<Vec<_>>(),
        )
    }

    /// Without a block of samples, and the block.
    pub fn split(&self, block: &Range<usize>) -> (Self, Self) {
        let (unseen, seen): (Vec<usize>, Vec<usize>) =
            (0..self.rows()).partition(|row| block.contains(row));
        (self.select(&seen), self.select(&unseen))
    }

    /// Virtual counts, scaled: a row per sample, a column per motor.
    pub fn virtual_counts(&self, weights: &[DVector<f64>]) -> DMatrix<f64> {
        let columns: Vec<_> = self
            .plays
            .iter()
            .zip(weights)
            .map(|(plays, weights)| plays * weights)
            .collect();
        DMatrix::from_columns(&columns)
    }

    /// What a residual of all lags sees, with a shape and lags times a shape of given degrees.
    pub fn features(&self, weights: &[DVector<f64>], (shape, lag): (usize, usize)) -> DMatrix<f64> {
        let lags = self
            .points
            .first()
            .map_or(0, |point| point.lags.as_slice().len());
        let virtual_counts = self.virtual_counts(weights);
        let mut matrix = DMatrix::zeros(self.rows(), count::<D>(shape, lag, lags));
        for (index, (mut row, point)) in matrix.row_iter_mut().zip(&self.points).enumerate() {
            let scaled =
                nalgebra::SVector::<f64, D>::from_fn(|motor, _| virtual_counts[(index, motor)]);
            let mut cells = row.iter_mut();
            features(&scaled, &point.lags, shape, lag, |feature| {
                if let Some(cell) = cells.next() {
                    *cell = feature;
                }
            });
        }
        matrix
    }
}

/// All weight on the threshold 0.
fn unit(size: usize) -> DVector<f64> {
    DVector::from_fn(size, |play, _| if play == 0 { 1.0 } else { 0.0 })
}
