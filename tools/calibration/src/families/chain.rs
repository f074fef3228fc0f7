//! The regression on virtual counts and the residual behind a hysteresis operator.
//!
//! 1. A ridge regression of the outputs on all features finds the part that goes with the lags.
//! 2. That part is subtracted, and a Gaussian mixture is fitted to `[virtual counts; outputs]`.
//!    Otherwise the mixture would treat the loop as noise. Where there is to be no residual,
//!    nothing is subtracted. The number of components is chosen by
//!    leaving out contiguous blocks.
//! 3. A residual is fitted to the rest, if that lowers the error on blocks left out.

use i2ris::model::file::{HullParameters, Mixture};
use i2ris::model::hysteresis::residual::ResidualParameters;
use i2ris::model::{Hull, MixtureRegression, ModelError};
use i2ris::units::MotorVec;
use nalgebra::DMatrix;

use super::operator_trace::{TracePoint, feature_matrix, shape_features};
use crate::em::{EmError, EmOptions};
use crate::progress::Progress;
use crate::regression::component_choice::choose_components;
use crate::regression::linear::rows_of;
use crate::regression::mixture::{RegressionData, residuals};
use crate::regression::ridge::ridge;
use crate::series::Series;
use crate::table::DataTable;

/// Components that are tried behind an operator, which leaves them little to bend: often nothing.
const TRIED: [usize; 7] = [1, 2, 3, 4, 6, 8, 10];

/// Shape and lag degrees of the residuals that are tried.
const DEGREES: [(usize, usize); 6] = [(5, 2), (5, 1), (5, 0), (3, 1), (3, 0), (1, 0)];

/// A residual has to lower the error on blocks left out by this part.
const LEAST_GAIN: f64 = 0.01;

/// How to fit the chain behind an operator.
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
    /// Over `[virtual counts; outputs]`.
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

/// Why no chain could be fitted behind an operator.
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

/// Fits the chain to the trace of an operator along a series.
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
        let inputs = self.virtual_counts.iter().copied();
        RegressionData::joint(
            DataTable::from_rows(self.motors, inputs),
            DataTable::from_matrix(outputs),
        )
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

#[cfg(test)]
mod tests {
    use i2ris::model::hysteresis::Operator;
    use i2ris::model::hysteresis::backlash_play::{PlayParameters, Plays};
    use nalgebra::SVector;

    use super::super::operator_trace::trace_plays;
    use super::*;
    use crate::progress::Silent;
    use crate::recording::Recording;
    use crate::testing::{few_starts, recording, straight, wander};

    fn plays() -> PlayParameters {
        PlayParameters {
            thresholds_counts: vec![vec![0.0, 40.0]; 2],
            weights: vec![vec![0.4, 0.6]; 2],
            planar_thresholds_counts: Vec::new(),
        }
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
        let options = ChainOptions {
            components: Some(1),
            residual,
            em: few_starts(2),
            ..ChainOptions::default()
        };
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
}
