//! What follows a hysteresis operator in a model with memory: a regression on the virtual counts,
//! and a residual.
//!
//! 1. A ridge regression of the outputs on all features tells which part of them goes with the
//!    lags.
//! 2. That part is taken off, and a Gaussian mixture is fitted to `[virtual counts; outputs]`:
//!    without it, the mixture would take the loop for noise and its responsibilities for shape. The
//!    number of components is chosen by leaving out contiguous blocks.
//! 3. What the mixture leaves of the outputs goes to the residual, if that helps with blocks it has
//!    not seen.

use i2ris::model::file::{HullParameters, MixtureParameters};
use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::read_out::ReadOut;
use i2ris::model::hysteresis::residual::{ResidualParameters, count, features};
use i2ris::model::{Hull, ModelError};
use i2ris::units::MotorVec;
use nalgebra::{DMatrix, SVector};

use crate::components::{choose_components, fewer};
use crate::em::{EmError, EmOptions, MixtureFit, fit_mixture};
use crate::progress::Progress;
use crate::ridge::{RidgeFit, ridge};
use crate::series::{Point, Series};
use crate::table::Table;

/// Shape and lag degrees of the residuals that are tried.
const DEGREES: [(usize, usize); 6] = [(5, 2), (5, 1), (5, 0), (3, 1), (3, 0), (1, 0)];

/// A residual has to lower the error on blocks left out by this part.
const WORTH_IT: f64 = 0.01;

/// How to fit what follows an operator.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainOptions {
    /// The most components of the mixture; chosen by leaving out blocks if `None`.
    pub components: Option<usize>,
    /// Whether to look for a residual.
    pub residual: bool,
    /// How to fit the mixture.
    pub em: EmOptions,
}

impl Default for ChainOptions {
    fn default() -> Self {
        Self {
            components: None,
            residual: true,
            em: EmOptions::default(),
        }
    }
}

/// What follows an operator, in the units of the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainFit {
    /// Mixture over `[virtual counts; outputs]`.
    pub mixture: MixtureParameters,
    /// The residual, if it is worth it.
    pub residual: Option<ResidualParameters>,
    /// The region of virtual counts that the samples visited.
    pub virtual_hull: HullParameters,
    /// Of the mixture, nats per row.
    pub log_likelihood: f64,
    /// Of the mixture.
    pub bic: f64,
    /// RMS length of the error of the residual's fit on blocks left out.
    pub cross_validated_rms: f64,
}

/// Why nothing could be fitted behind an operator.
#[derive(Debug, thiserror::Error)]
pub enum ChainError {
    /// No mixture.
    #[error(transparent)]
    Mixture(#[from] EmError),
    /// The mixture or the region of virtual counts is refused.
    #[error(transparent)]
    Refused(#[from] ModelError),
    /// The virtual counts do not move.
    #[error(
        "the outputs cannot be regressed on the virtual counts: a motor does not move them, or there are too few samples"
    )]
    Degenerate,
}

/// Fits what follows an operator.
///
/// # Errors
///
/// See [`ChainError`].
pub fn fit_chain<O: Operator<D>, const D: usize>(
    operator: &O,
    series: &Series,
    options: &ChainOptions,
    progress: &dyn Progress,
) -> Result<ChainFit, ChainError> {
    let points = series.trace(operator);
    let data = Data {
        points: &points,
        outputs: series.outputs(),
        scale_counts: scale(&points),
    };
    let virtual_points: Vec<MotorVec> = points
        .iter()
        .map(|point| padded(&point.virtual_counts))
        .collect();
    let virtual_hull = Hull::from_points(D, &virtual_points)?.parameters();
    let joint = data.joint(&data.without_lags()?);
    let components = match options.components {
        Some(components) => components,
        None => choose_components::<D>(&joint, series.outputs(), &options.em, progress),
    };
    let mixture = mixture(&joint, components, &options.em, progress)?;
    let left = data.left_by(&ReadOut::prepare(&mixture.parameters, series.outputs())?);
    let (residual, error) = if options.residual {
        data.residual(&left)
    } else {
        (None, mean_square(&left))
    };
    let MixtureFit {
        parameters,
        log_likelihood,
        bic,
        ..
    } = mixture;
    let cross_validated_rms = error.sqrt();
    Ok(ChainFit {
        mixture: parameters,
        residual,
        virtual_hull,
        log_likelihood,
        bic,
        cross_validated_rms,
    })
}

/// A mixture of so many components, or of fewer where some of them starve.
fn mixture(
    joint: &Table,
    mut components: usize,
    em: &EmOptions,
    progress: &dyn Progress,
) -> Result<MixtureFit, EmError> {
    loop {
        match (
            fit_mixture(joint, components, em, progress),
            fewer(components),
        ) {
            (Err(EmError::NoStartSucceeded { .. }), Some(fewer)) => components = fewer,
            (fit, _) => return fit,
        }
    }
}

struct Data<'a, const D: usize> {
    points: &'a [Point<D>],
    outputs: usize,
    scale_counts: f64,
}

impl<const D: usize> Data<'_, D> {
    fn features(&self, (shape_degree, lag_degree): (usize, usize)) -> DMatrix<f64> {
        let lags = self
            .points
            .first()
            .map_or(0, |point| point.lags.as_slice().len());
        let mut matrix = DMatrix::zeros(
            self.points.len(),
            count::<D>(shape_degree, lag_degree, lags),
        );
        for (mut row, point) in matrix.row_iter_mut().zip(self.points) {
            let mut cells = row.iter_mut();
            features(
                &(point.virtual_counts / self.scale_counts),
                &point.lags,
                shape_degree,
                lag_degree,
                |feature| {
                    if let Some(cell) = cells.next() {
                        *cell = feature;
                    }
                },
            );
        }
        matrix
    }

    fn measured(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.points.len(), self.outputs, |row, output| {
            self.points[row].outputs[output]
        })
    }

    /// The outputs without what goes with the lags.
    fn without_lags(&self) -> Result<DMatrix<f64>, ChainError> {
        let measured = self.measured();
        let degrees = DEGREES[0];
        let mut features = self.features(degrees);
        let fit = ridge(&features, &measured).ok_or(ChainError::Degenerate)?;
        features
            .columns_mut(0, count::<D>(degrees.0, 0, 0))
            .fill(0.0);
        Ok(measured - features * fit.coefficients)
    }

    fn joint(&self, outputs: &DMatrix<f64>) -> Table {
        let rows = self.points.iter().zip(outputs.row_iter());
        let rows = rows.map(|(point, outputs)| {
            let outputs: Vec<f64> = outputs.iter().copied().collect();
            point
                .virtual_counts
                .iter()
                .copied()
                .chain(outputs)
                .collect::<Vec<_>>()
        });
        Table::from_rows(D + self.outputs, rows)
    }

    /// What a regression leaves of the outputs.
    fn left_by(&self, read_out: &ReadOut<D>) -> DMatrix<f64> {
        let mut left = self.measured();
        for (mut row, point) in left.row_iter_mut().zip(self.points) {
            let predicted = read_out.at(&point.virtual_counts);
            row.iter_mut()
                .zip(predicted)
                .for_each(|(left, predicted)| *left -= predicted);
        }
        left
    }

    /// The residual that does best on blocks left out, and the mean square of its error there.
    fn residual(&self, left: &DMatrix<f64>) -> (Option<ResidualParameters>, f64) {
        let tried: Vec<_> = DEGREES
            .iter()
            .filter_map(|d| Some((d, ridge(&self.features(*d), left)?)))
            .collect();
        let best = tried
            .into_iter()
            .min_by(|a, b| a.1.left_out_error.total_cmp(&b.1.left_out_error));
        let alone = mean_square(left);
        match best {
            Some((degrees, fit)) if fit.left_out_error < alone * (1.0 - WORTH_IT) => {
                (Some(self.parameters(*degrees, &fit)), fit.left_out_error)
            }
            _ => (None, alone),
        }
    }

    fn parameters(
        &self,
        (shape_degree, lag_degree): (usize, usize),
        fit: &RidgeFit,
    ) -> ResidualParameters {
        let coefficients = fit
            .coefficients
            .column_iter()
            .map(|column| column.iter().copied().collect())
            .collect();
        ResidualParameters {
            scale_counts: self.scale_counts,
            shape_degree,
            lag_degree,
            coefficients,
        }
    }
}

/// The largest virtual count: powers of what is divided by it stay near 1.
fn scale<const D: usize>(points: &[Point<D>]) -> f64 {
    points
        .iter()
        .map(|point| point.virtual_counts.amax())
        .fold(1.0, f64::max)
}

fn mean_square(errors: &DMatrix<f64>) -> f64 {
    errors.norm_squared() / errors.nrows().max(1) as f64
}

fn padded<const D: usize>(virtual_counts: &SVector<f64, D>) -> MotorVec {
    let mut padded = MotorVec::default();
    padded
        .iter_mut()
        .zip(virtual_counts.iter())
        .for_each(|(to, from)| *to = *from);
    padded
}

#[cfg(test)]
mod tests {
    use i2ris::model::hysteresis::backlash_play::{PlayParameters, Plays};

    use super::*;
    use crate::progress::Silent;
    use crate::recording::Recording;
    use crate::testing::{recording, straight, wander};

    fn plays() -> Plays<2> {
        let parameters = PlayParameters {
            thresholds_counts: vec![vec![0.0, 40.0]; 2],
            weights: vec![vec![0.4, 0.6]; 2],
            planar_thresholds_counts: Vec::new(),
        };
        Plays::prepare(&parameters).unwrap()
    }

    /// Outputs that go with the virtual counts, and some of them with a lag.
    fn dragged(lag_share: f64) -> Recording {
        let operator = plays();
        let mut state = operator.begin(&SVector::from(wander(0.0)));
        recording(900, |time| {
            let counts = SVector::from(wander(time));
            operator.advance(&mut state, &counts);
            let virtual_counts = operator.local(&state, &counts).mean;
            let [pitch, yaw] = straight([virtual_counts[0], virtual_counts[1]]);
            let lags = operator.lags(&state);
            (wander(time), [pitch + lag_share * lags.as_slice()[0], yaw])
        })
    }

    fn fit(recording: &Recording, residual: bool) -> ChainFit {
        let series = Series::new(recording, &(0..recording.rows().len()).collect::<Vec<_>>());
        let em = EmOptions {
            restarts: 2,
            ..EmOptions::default()
        };
        fit_chain(
            &plays(),
            &series,
            &ChainOptions {
                components: Some(1),
                residual,
                em,
            },
            &Silent,
        )
        .unwrap()
    }

    #[test]
    fn a_straight_read_out_needs_no_residual() {
        let found = fit(&dragged(0.0), true);
        assert!(
            found.cross_validated_rms < 0.01,
            "{}",
            found.cross_validated_rms
        );
        let corners = found.virtual_hull.corners;
        assert!(
            corners.iter().flatten().all(|corner| corner.abs() < 450.0),
            "{corners:?}"
        );
    }

    #[test]
    fn what_goes_with_a_lag_is_taken_by_the_residual() {
        let recording = dragged(0.5);
        let (without, with) = (fit(&recording, false), fit(&recording, true));
        assert!(with.residual.is_some() && without.residual.is_none());
        assert!(
            without.cross_validated_rms > 0.2,
            "{}",
            without.cross_validated_rms
        );
        assert!(
            with.cross_validated_rms < 0.02,
            "{}",
            with.cross_validated_rms
        );
    }
}
