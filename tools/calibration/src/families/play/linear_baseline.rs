//! The baseline of the hysteresis literature: play operators with a linear read-out, without shape
//! and mixture. It is fitted to compare with, not to control a robot.

use i2ris::model::ModelError;
use i2ris::units::MAX_OUTPUTS;
use nalgebra::DMatrix;

use super::super::operator_trace::{UnknownMemory, trace_plays};
use super::PlayError;
use super::threshold_search::TOPS;
use super::thresholds::{ThresholdRange, Thresholds};
use crate::parallel;
use crate::regression::ridge::ridge;
use crate::series::Series;

/// Plays per motor above the threshold 0.
const COUNT: usize = 10;

/// Plays with a linear read-out.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearPlays {
    thresholds: Thresholds,
    /// Row: constant, then the counts and lags of every motor; column: output.
    coefficients: DMatrix<f64>,
}

impl LinearPlays {
    /// Fits a linear read-out of the plays to all samples; the penalty of the regression and the
    /// reach of the thresholds are chosen by leaving out blocks.
    ///
    /// # Errors
    ///
    /// When a motor hardly moves.
    pub fn fit(series: &Series) -> Result<Self, PlayError> {
        let ranges = ThresholdRange::of_motors(series).map_err(PlayError::Still)?;
        let rows = series.samples();
        let outputs =
            DMatrix::from_fn(rows.len(), series.outputs(), |row, output| rows[row].outputs[output]);
        let tried = parallel::map(TOPS.len(), |top| {
            let motors = ranges.iter().map(|range| range.grid(COUNT, TOPS[top])).collect();
            let thresholds = Thresholds { motors, planar: Vec::new() };
            let fit = ridge(&features(&thresholds, series).ok()?, &outputs)?;
            let coefficients = fit.coefficients;
            Some((fit.left_out_error, Self { thresholds, coefficients }))
        });
        let best = tried.into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
        best.map(|(_, fit)| fit).ok_or(PlayError::Degenerate)
    }

    /// The outputs at every sample of a series, whose path the memory follows from the first
    /// position on.
    ///
    /// # Errors
    ///
    /// When the series has another number of motors.
    pub fn predict(&self, series: &Series) -> Result<Vec<[f64; MAX_OUTPUTS]>, PlayError> {
        let predicted = features(&self.thresholds, series)? * &self.coefficients;
        let padded = |row: usize| {
            std::array::from_fn(|output| predicted.row(row).get(output).copied().unwrap_or(0.0))
        };
        Ok((0..predicted.nrows()).map(padded).collect())
    }
}

/// A constant, counts and lags at every sample, also where the memory is not known yet.
fn features(thresholds: &Thresholds, series: &Series) -> Result<DMatrix<f64>, ModelError> {
    let motors = thresholds.motors.len();
    let points = trace_plays(series, &thresholds.idle(), UnknownMemory::Keep)?;
    let feature = |row: usize, column: usize| match column {
        0 => 1.0,
        _ if column <= motors => points[row].virtual_counts[column - 1],
        _ => points[row].lags.as_slice()[column - motors - 1],
    };
    Ok(DMatrix::from_fn(points.len(), 1 + motors + motors * COUNT, feature))
}
