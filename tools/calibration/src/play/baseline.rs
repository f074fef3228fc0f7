//! The baseline of the hysteresis literature: play operators with a linear read-out, no shape and
//! no mixture. It is fitted to be compared with, not to be driven.

use i2ris::model::ModelError;
use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::backlash_play::Plays;
use i2ris::units::MAX_OUTPUTS;
use nalgebra::{DMatrix, DVector, SVector};
use rayon::prelude::*;

use super::PlayError;
use super::search::ranges;
use super::stage::Thresholds;
use super::thresholds::Range;
use crate::ridge::ridge;
use crate::series::Series;

/// Plays per motor above the threshold 0.
const COUNT: usize = 10;

/// Tops of the thresholds that are tried, as parts of the range.
const TOPS: [f64; 6] = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

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
        let ranges =
            ranges(series.path(), series.motors()).map_err(|motor| PlayError::Still { motor })?;
        let outputs = DMatrix::from_fn(series.samples().len(), series.outputs(), |row, output| {
            series.samples()[row].outputs[output]
        });
        let tried: Vec<Option<(f64, Self)>> = TOPS
            .into_par_iter()
            .map(|top| {
                let thresholds = grids(&ranges, top);
                let fit = ridge(&features(&thresholds, series).ok()?, &outputs)?;
                Some((
                    fit.left_out_error,
                    Self {
                        thresholds,
                        coefficients: fit.coefficients,
                    },
                ))
            })
            .collect();
        let best = tried
            .into_iter()
            .flatten()
            .min_by(|a, b| a.0.total_cmp(&b.0));
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

fn grids(ranges: &[Range], top: f64) -> Thresholds {
    Thresholds {
        motors: ranges.iter().map(|range| range.grid(COUNT, top)).collect(),
        planar: Vec::new(),
    }
}

fn features(thresholds: &Thresholds, series: &Series) -> Result<DMatrix<f64>, ModelError> {
    match series.motors() {
        1 => features_sized::<1>(thresholds, series),
        _ => features_sized::<2>(thresholds, series),
    }
}

/// A constant, counts and lags at every sample, also where the memory is not known yet.
fn features_sized<const D: usize>(
    thresholds: &Thresholds,
    series: &Series,
) -> Result<DMatrix<f64>, ModelError> {
    let first =
        |motor: &Vec<f64>| DVector::from_fn(motor.len(), |play, _| f64::from(u8::from(play == 0)));
    let operator = Plays::<D>::prepare(
        &thresholds.with(&thresholds.motors.iter().map(first).collect::<Vec<_>>()),
    )?;
    let counts = |place: usize| SVector::<f64, D>::from_fn(|motor, _| series.path()[place][motor]);
    let mut rows = DMatrix::zeros(
        series.samples().len(),
        1 + D + thresholds.motors.len() * COUNT,
    );
    if rows.is_empty() {
        return Ok(rows);
    }
    let (mut state, mut next) = (operator.begin(&counts(0)), 0);
    for (mut row, sample) in rows.row_iter_mut().zip(series.samples()) {
        (next..=sample.place).for_each(|place| operator.advance(&mut state, &counts(place)));
        next = sample.place + 1;
        let (here, lags) = (counts(sample.place), operator.lags(&state));
        let cells = std::iter::once(1.0)
            .chain(here.iter().copied())
            .chain(lags.as_slice().iter().copied());
        row.iter_mut()
            .zip(cells)
            .for_each(|(cell, value)| *cell = value);
    }
    Ok(rows)
}
