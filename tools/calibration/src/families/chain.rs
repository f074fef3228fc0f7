//! The regression on virtual counts and the residual behind a hysteresis operator.
//!
//! 1. A ridge regression of the outputs on all features finds the part that goes with the lags.
//! 2. That part is subtracted, and a Gaussian mixture is fitted to `[virtual counts; outputs]`.
//!    Otherwise the mixture would treat the loop as noise. Where there is to be no residual,
//!    nothing is subtracted. The number of components is chosen by
//!    leaving out contiguous blocks.
//! 3. A residual is fitted to the rest, if that lowers the error on blocks left out.

use i2ris::model::file::{HullParameters, Mixture};
use i2ris::model::hysteresis::backlash_play::{PlayParameters, Plays};
use i2ris::model::hysteresis::residual::{ResidualParameters, count, features};
use i2ris::model::hysteresis::{Lags, Operator};
use i2ris::model::{Hull, MixtureRegression, ModelError};
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use i2ris_report::statistics::min_max;
use nalgebra::{DMatrix, SVector};

use crate::em::{EmError, EmOptions};
use crate::progress::Progress;
use crate::regression::component_choice::choose_components;
use crate::regression::linear::rows_of;
use crate::regression::mixture::{RegressionData, residuals};
use crate::regression::ridge::ridge;
use crate::series::{Sample, Series};
use crate::table::DataTable;

/// Components that are tried behind an operator, which leaves them little to bend: often nothing.
const TRIED: [usize; 7] = [1, 2, 3, 4, 6, 8, 10];

/// Tried shape and lag degrees of a residual, which must lower the error left out by this part.
const DEGREES: [(usize, usize); 6] = [(5, 2), (5, 1), (5, 0), (3, 1), (3, 0), (1, 0)];
const LEAST_GAIN: f64 = 0.01;

#[derive(Debug, Clone, PartialEq)]
pub struct ChainOptions {
    /// The components of the mixture; chosen by leaving out blocks if `None`.
    pub components: Option<usize>,
    /// The part of the covariance of all rows that every component is given.
    pub smoothing: f64,
    pub residual: bool,
    pub em: EmOptions,
}

impl Default for ChainOptions {
    fn default() -> Self {
        Self { components: None, smoothing: 0.0, residual: true, em: EmOptions::default() }
    }
}

/// The chain behind an operator, in the units of the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainFit {
    pub mixture: Mixture,
    pub residual: Option<ResidualParameters>,
    /// The region of virtual counts that the samples visited.
    pub virtual_hull: HullParameters,
    /// Of the mixture, nats per row.
    pub log_likelihood: f64,
    pub bic: f64,
    /// RMS length of the error of the residual's fit on blocks left out.
    pub cross_validated_rms: f64,
}

#[derive(Debug, thiserror::Error)]
pub enum ChainError {
    #[error(transparent)]
    Mixture(#[from] EmError),
    #[error(transparent)]
    Refused(#[from] ModelError),
    #[error(
        "the outputs cannot be regressed on the virtual counts: a motor does not move them, or \
         there are too few samples"
    )]
    Degenerate,
}

pub fn fit_chain(
    series: &Series,
    points: &[TracePoint],
    options: &ChainOptions,
    progress: &dyn Progress,
) -> Result<ChainFit, ChainError> {
    let data = ChainData::new(series, points);
    let virtual_hull = Hull::from_points(data.motors, &data.virtual_counts)?.parameters();
    // Without a residual nothing may be left to it.
    let rows = match options.residual {
        true => data.rows(&data.without_lags()?),
        false => data.rows(&data.measured),
    };
    let components = options
        .components
        .unwrap_or_else(|| choose_components(&rows, &TRIED, &options.em, progress));
    let fit = rows.fit(components.min(rows.most_components()), &options.em, progress)?;
    let mixture = rows.smoothed(&fit.mixture, options.smoothing);
    let regression = MixtureRegression::prepare(&mixture, data.motors, series.outputs())?;
    let rest = residuals(&regression, &data.virtual_counts, &data.measured);
    let (residual, error) = match options.residual {
        true => data.residual(&rest),
        false => (None, mean_square(&rest)),
    };
    Ok(ChainFit {
        mixture,
        residual,
        virtual_hull,
        log_likelihood: fit.log_likelihood,
        bic: fit.bic,
        cross_validated_rms: error.sqrt(),
    })
}

struct ChainData<'a> {
    motors: usize,
    points: &'a [TracePoint],
    virtual_counts: Vec<MotorVec>,
    measured: DMatrix<f64>,
    /// The largest virtual count: powers of scaled counts stay near 1.
    scale_counts: f64,
}

impl<'a> ChainData<'a> {
    fn new(series: &Series, points: &'a [TracePoint]) -> Self {
        let virtual_counts: Vec<MotorVec> = points.iter().map(|p| p.virtual_counts).collect();
        let counts = virtual_counts.iter().flatten();
        let scale_counts = counts.fold(1.0, |most: f64, count| most.max(count.abs()));
        let output = |row: usize, output: usize| points[row].outputs[output];
        let measured = DMatrix::from_fn(points.len(), series.outputs(), output);
        Self { motors: series.motors(), points, virtual_counts, measured, scale_counts }
    }

    fn features(&self, degrees: (usize, usize)) -> DMatrix<f64> {
        let lags = self.points.first().map_or(0, |point| point.lags.as_slice().len());
        feature_matrix(self.motors, (self.points.len(), lags), degrees, &|row| {
            let scaled = self.virtual_counts[row].map(|v| v / self.scale_counts);
            (scaled, self.points[row].lags)
        })
    }

    /// The outputs without the part that goes with the lags.
    fn without_lags(&self) -> Result<DMatrix<f64>, ChainError> {
        let mut features = self.features(DEGREES[0]);
        let fit = ridge(&features, &self.measured).ok_or(ChainError::Degenerate)?;
        features.columns_mut(0, shape_features(self.motors, DEGREES[0].0)).fill(0.0);
        Ok(&self.measured - features * fit.coefficients)
    }

    fn rows(&self, outputs: &DMatrix<f64>) -> RegressionData {
        let inputs = DataTable::from_rows(self.motors, self.virtual_counts.iter().copied());
        RegressionData::joint(inputs, DataTable::from_matrix(outputs))
    }

    /// The residual with the least error on blocks left out, and the mean square of that error.
    fn residual(&self, rest: &DMatrix<f64>) -> (Option<ResidualParameters>, f64) {
        let tried = DEGREES.iter().filter_map(|d| Some((d, ridge(&self.features(*d), rest)?)));
        let best = tried.min_by(|a, b| a.1.left_out_error.total_cmp(&b.1.left_out_error));
        let without = mean_square(rest);
        match best {
            Some((degrees, fit)) if fit.left_out_error < without * (1.0 - LEAST_GAIN) => {
                let residual = ResidualParameters {
                    scale_counts: self.scale_counts,
                    shape_degree: degrees.0,
                    lag_degree: degrees.1,
                    coefficients: rows_of(&fit.coefficients.transpose()),
                };
                (Some(residual), fit.left_out_error)
            }
            _ => (None, without),
        }
    }
}

fn mean_square(errors: &DMatrix<f64>) -> f64 {
    errors.norm_squared() / errors.nrows().max(1) as f64
}

/// The state of an operator at one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    /// Virtual counts; entries beyond the number of motors are 0.
    pub virtual_counts: MotorVec,
    pub lags: Lags,
    pub outputs: [f64; MAX_OUTPUTS],
}

/// Minimum part of every motor's range that the remaining samples must cover.
const MIN_COVERAGE: f64 = 0.9;

/// Runs play operators along the path. Samples before their memory is known are left out, unless
/// that leaves less than half of the samples, or a smaller region of the motors: a model of short
/// recordings would not cover the full motor range. Fails if the operator is refused.
pub fn trace_plays(series: &Series, plays: &PlayParameters) -> Result<Vec<TracePoint>, ModelError> {
    Ok(match series.motors() {
        1 => trace::<_, 1>(series, &Plays::prepare(plays)?),
        _ => trace::<_, 2>(series, &Plays::prepare(plays)?),
    })
}

fn trace<O: Operator<D>, const D: usize>(series: &Series, operator: &O) -> Vec<TracePoint> {
    let counts = |counts: &MotorVec| SVector::<f64, D>::from_fn(|motor, _| counts[motor]);
    let Some(first) = series.path().first() else { return Vec::new() };
    let mut state = operator.begin(&counts(first));
    let mut points = Vec::with_capacity(series.samples().len());
    let mut next = 0;
    for sample in series.samples() {
        for position in &series.path()[next..=sample.path_index] {
            operator.advance(&mut state, &counts(position));
        }
        next = sample.path_index + 1;
        let local = operator.local(&state, &counts(&series.path()[sample.path_index]));
        let mut virtual_counts = MotorVec::default();
        virtual_counts[..D].copy_from_slice(local.mean.as_slice());
        let (lags, outputs) = (operator.lags(&state), sample.outputs);
        points.push(TracePoint { virtual_counts, lags, outputs });
    }
    let known = series.covered_from(&operator.conditioning_range());
    let before = series.samples().partition_point(|sample| sample.path_index < known);
    if 2 * before <= points.len() && covers(series, before) {
        points.drain(..before);
    }
    points
}

/// Whether the samples without the first ones cover almost the same region.
fn covers(series: &Series, first: usize) -> bool {
    let range = |samples: &[Sample], motor: usize| {
        let counts = samples.iter().map(|sample| series.path()[sample.path_index][motor]);
        let (low, high) = min_max(counts);
        high - low
    };
    let (all, rest) = (series.samples(), &series.samples()[first..]);
    (0..series.motors()).all(|motor| range(rest, motor) >= MIN_COVERAGE * range(all, motor))
}

/// A row of residual features per sample: monomials of the scaled counts up to the first degree,
/// then each lag times the monomials up to the second. `row` returns counts and lags of a sample.
pub(crate) fn feature_matrix(
    motors: usize,
    (rows, lags): (usize, usize),
    degrees: (usize, usize),
    row: &dyn Fn(usize) -> (MotorVec, Lags),
) -> DMatrix<f64> {
    match motors {
        1 => sized_features::<1>(rows, lags, degrees, row),
        _ => sized_features::<2>(rows, lags, degrees, row),
    }
}

fn sized_features<const D: usize>(
    rows: usize,
    lags: usize,
    (shape, lag): (usize, usize),
    row: &dyn Fn(usize) -> (MotorVec, Lags),
) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(rows, count::<D>(shape, lag, lags));
    for (index, mut cells) in matrix.row_iter_mut().enumerate() {
        let (counts, lags) = row(index);
        let mut column = 0;
        features(&SVector::<f64, D>::from_fn(|motor, _| counts[motor]), &lags, shape, lag, |x| {
            cells[column] = x;
            column += 1;
        });
    }
    matrix
}

pub(crate) fn shape_features(motors: usize, degree: usize) -> usize {
    match motors {
        1 => count::<1>(degree, 0, 0),
        _ => count::<2>(degree, 0, 0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::recording::Recording;
    use crate::testing::{few_starts, one_motor, plays_of, recording, straight, wander};

    fn plays() -> PlayParameters {
        plays_of(vec![vec![0.0, 40.0]; 2], vec![vec![0.4, 0.6]; 2])
    }

    /// Outputs that go with the virtual counts, and some of them with a lag.
    fn with_lag(lag_share: f64) -> Recording {
        let operator = Plays::<2>::prepare(&plays()).unwrap();
        let mut state = operator.begin(&SVector::from(wander(0.0)));
        recording(900, |time| {
            let counts = SVector::from(wander(time));
            operator.advance(&mut state, &counts);
            let [pitch, yaw] = straight(operator.local(&state, &counts).mean.into());
            let lags = operator.lags(&state);
            (wander(time), [pitch + lag_share * lags.as_slice()[0], yaw])
        })
    }

    fn fit(recording: &Recording, residual: bool) -> ChainFit {
        let series = Series::whole(recording);
        let points = trace_plays(&series, &plays()).unwrap();
        let (components, em) = (Some(1), few_starts(2));
        let options = ChainOptions { components, residual, em, ..ChainOptions::default() };
        fit_chain(&series, &points, &options, &Silent).unwrap()
    }

    #[test]
    fn a_straight_relation_needs_no_residual() {
        let found = fit(&with_lag(0.0), true);
        assert!(found.cross_validated_rms < 0.01, "{found:?}");
        let corners = found.virtual_hull.corners;
        assert!(corners.iter().flatten().all(|corner| corner.abs() < 450.0), "{corners:?}");
    }

    #[test]
    fn the_residual_takes_what_goes_with_a_lag() {
        let recording = with_lag(0.5);
        let (without, with) = (fit(&recording, false), fit(&recording, true));
        assert!(with.residual.is_some() && without.residual.is_none());
        let (without, with) = (without.cross_validated_rms, with.cross_validated_rms);
        assert!(without > 0.2 && with < 0.02, "{without} {with}");
    }

    fn trace(series: &Series, threshold: f64) -> Vec<TracePoint> {
        let plays = plays_of(vec![vec![0.0, threshold]], vec![vec![0.5, 0.5]]);
        trace_plays(series, &plays).unwrap()
    }

    #[test]
    fn every_sample_gets_the_state_of_its_own_position() {
        let recording = one_motor(40, |time| (50.0 * (2.0 * time).sin(), time));
        let rows: Vec<usize> = (0..40).step_by(3).collect();
        let all = trace(&Series::whole(&recording), 0.5);
        let some = trace(&Series::new(&recording, &rows), 0.5);
        let expected = rows[rows.len() - some.len()..].iter().map(|row| all[all.len() + row - 40]);
        assert_eq!(some, expected.collect::<Vec<_>>());
    }

    #[test]
    fn samples_before_the_memory_is_known_are_left_out() {
        let series = Series::whole(&one_motor(100, |time| (10.0 * time, time)));
        // 2 counts a row, and a play of 8 counts is known after a range of 16.
        assert_eq!(trace(&series, 8.0).len(), 92);
        assert_eq!(trace(&series, 30.0).len(), 100, "the rest would not cover the lower end");
        assert_eq!(trace(&series, 80.0).len(), 100, "it never is, so all of them are used");
    }
}
