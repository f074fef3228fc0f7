//! Gaussian mixture regression on the counts and the direction of travel: dead-bands and mixture.
//!
//! 1. The dead-band of every motor is the one whose directions explain most of the outputs: each is
//!    tested by the error on blocks left out of a ridge regression on cubic monomials of the
//!    counts and on every direction times the linear ones.
//! 2. A Gaussian mixture is fitted to `[counts; directions; outputs]`, a direction being 1 or -1.
//!    The number of components is chosen by leaving out contiguous blocks.

use i2ris::model::direction::{Direction, LEAST_DEAD_BAND_COUNTS, Travel};
use i2ris::model::file::FamilyParameters;
use i2ris::model::hysteresis::Lags;
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec};
use nalgebra::DMatrix;

use super::operator_trace::feature_matrix;
use crate::em::error::EmError;
use crate::em::mixture::MixtureFit;
use crate::em::options::EmOptions;
use crate::em::restarts::fit_mixture;
use crate::progress::Progress;
use crate::regression::component_choice::choose_components;
use crate::regression::ridge::ridge;
use crate::series::Series;
use crate::table::DataTable;
use i2ris_report::statistics::min_max;

/// Dead-bands that are tried, counts.
const DEAD_BANDS_COUNTS: [f64; 11] =
    [LEAST_DEAD_BAND_COUNTS, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 50.0, 80.0, 120.0];

/// The widest dead-band that is tried, as a part of the range of the motor.
const WIDEST: f64 = 0.25;

/// The dead-bands are chosen from so many rows.
const CHOICE_ROWS: usize = 3000;

/// Degree of the monomials of the counts, and of those that multiply a direction.
const DEGREES: (usize, usize) = (3, 1);

/// How to fit it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DirectionOptions {
    /// Components of the mixture; chosen by leaving out blocks if `None`.
    pub components: Option<usize>,
    /// How to fit the mixture.
    pub em: EmOptions,
}

/// A fitted model, in the units of the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionFit {
    /// Of the family `gmr-direction`.
    pub parameters: FamilyParameters,
    /// Components of the mixture.
    pub components: usize,
    /// Of the mixture, nats per row; directions are variables of it.
    pub log_likelihood: f64,
    /// Of the mixture.
    pub bic: f64,
}

/// Why there is no such model.
#[derive(Debug, thiserror::Error)]
pub enum DirectionError {
    /// A direction that never changes.
    #[error(
        "motor {motor} never turns back where something was measured, so the data do not show the \
         effect of its direction; record motion with reversals, or fit a family without directions"
    )]
    NeverTurns {
        /// Counted from 0.
        motor: usize,
    },
    /// No mixture.
    #[error(transparent)]
    Mixture(#[from] EmError),
}

/// Fits Gaussian mixture regression on counts and directions.
///
/// # Errors
///
/// When a motor never turns, or the rows do not determine a mixture.
pub fn fit_direction(
    series: &Series,
    options: &DirectionOptions,
    progress: &dyn Progress,
) -> Result<DirectionFit, DirectionError> {
    let dead_bands = choose_dead_bands(series);
    let rows = rows(series, &dead_bands);
    every_motor_turns(&rows, series.motors())?;
    let joint = joint(&rows, series);
    let inputs = 2 * series.motors();
    let components = options
        .components
        .unwrap_or_else(|| choose_components(&joint, inputs, &options.em, progress));
    let MixtureFit { parameters: mixture, log_likelihood, bic, .. } =
        fit_mixture(&joint, components, &options.em, progress)?;
    let dead_bands_counts = dead_bands[..series.motors()].to_vec();
    let parameters = FamilyParameters::GmrDirection { dead_bands_counts, mixture };
    Ok(DirectionFit { parameters, components, log_likelihood, bic })
}

/// A sample, with the directions where they are known.
struct DirectionSample {
    counts: MotorVec,
    directions: [Option<f64>; MAX_MOTORS],
    outputs: [f64; MAX_OUTPUTS],
}

impl DirectionSample {
    fn direction(&self, motor: usize) -> f64 {
        self.directions[motor].unwrap_or_default()
    }
}

/// The samples from where every direction is known.
fn rows(series: &Series, dead_bands: &MotorVec) -> Vec<DirectionSample> {
    let Some(first) = series.path().first() else {
        return Vec::new();
    };
    let mut travels = first.map(Travel::begin);
    let mut next = 0;
    let mut rows = Vec::with_capacity(series.samples().len());
    for sample in series.samples() {
        for counts in &series.path()[next..=sample.path_index] {
            for (motor, travel) in travels.iter_mut().enumerate() {
                *travel = travel.advanced(counts[motor], dead_bands[motor]);
            }
        }
        next = sample.path_index + 1;
        let directions = travels.map(|travel| travel.direction().variable());
        if directions[..series.motors()].iter().all(Option::is_some) {
            rows.push(DirectionSample {
                counts: series.counts(sample),
                directions,
                outputs: sample.outputs,
            });
        }
    }
    rows
}

fn every_motor_turns(rows: &[DirectionSample], motors: usize) -> Result<(), DirectionError> {
    for motor in 0..motors {
        let moves = |direction: Direction| {
            rows.iter().any(|row| row.directions[motor] == direction.variable())
        };
        if !moves(Direction::Up) || !moves(Direction::Down) {
            return Err(DirectionError::NeverTurns { motor });
        }
    }
    Ok(())
}

fn joint(rows: &[DirectionSample], series: &Series) -> DataTable {
    let (motors, outputs) = (series.motors(), series.outputs());
    let cells = |row: &DirectionSample| {
        let directions = (0..motors).map(|motor| row.direction(motor));
        let inputs = row.counts.into_iter().take(motors).chain(directions);
        inputs.chain(row.outputs.into_iter().take(outputs)).collect::<Vec<_>>()
    };
    DataTable::from_rows(2 * motors + outputs, rows.iter().map(cells))
}

/// The best dead-band for all motors together, and then for each by itself.
fn choose_dead_bands(series: &Series) -> MotorVec {
    let motors = series.motors();
    let fits = |motor: usize, band: f64| {
        let (low, high) = min_max(series.path().iter().map(|counts| counts[motor]));
        band <= (WIDEST * (high - low)).max(LEAST_DEAD_BAND_COUNTS)
    };
    let best = |candidates: Vec<MotorVec>| {
        let candidates = candidates.into_iter();
        let tried = candidates.filter_map(|bands| Some((left_out_error(series, &bands)?, bands)));
        tried.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, bands)| bands)
    };
    let fit_all = |band: &f64| (0..motors).all(|motor| fits(motor, *band));
    let together = DEAD_BANDS_COUNTS.into_iter().filter(fit_all);
    let together = best(together.map(|band| [band; MAX_MOTORS]).collect());
    let mut bands = together.unwrap_or([LEAST_DEAD_BAND_COUNTS; MAX_MOTORS]);
    for motor in 0..if motors == 1 { 0 } else { motors } {
        let with = |band: f64| {
            let mut bands = bands;
            bands[motor] = band;
            bands
        };
        let candidates = DEAD_BANDS_COUNTS.into_iter().filter(|band| fits(motor, *band));
        bands = best(candidates.map(with).collect()).unwrap_or(bands);
    }
    bands
}

/// Mean squared error of the ridge regression on blocks left out; `None` where the rows do not
/// determine it.
fn left_out_error(series: &Series, dead_bands: &MotorVec) -> Option<f64> {
    let rows = rows(series, dead_bands);
    let step = rows.len().div_ceil(CHOICE_ROWS).max(1);
    let rows: Vec<DirectionSample> = rows.into_iter().step_by(step).collect();
    let features = regressors(&rows, series.motors());
    let output = |row: usize, output: usize| rows[row].outputs[output];
    let outputs = DMatrix::from_fn(rows.len(), series.outputs(), output);
    if rows.len() <= features.ncols() {
        return None;
    }
    ridge(&features, &outputs).map(|fit| fit.left_out_error)
}

fn regressors(rows: &[DirectionSample], motors: usize) -> DMatrix<f64> {
    let counts = rows.iter().flat_map(|row| row.counts);
    let scale = counts.fold(1.0, |scale: f64, count| scale.max(count.abs()));
    feature_matrix(motors, (rows.len(), motors), DEGREES, &|row| {
        let row = &rows[row];
        let mut directions = Lags::default();
        for motor in 0..motors {
            directions.push(row.direction(motor));
        }
        (row.counts.map(|count| count / scale), directions)
    })
}

#[cfg(test)]
mod tests {
    use i2ris::model::file::MixtureParameters;

    use super::*;
    use crate::progress::Silent;
    use crate::recording::Recording;
    use crate::testing::{assert_contains, assert_near, few_starts, noise, one_motor, recording};
    use crate::testing::{straight, wander};

    fn fit(
        recording: &Recording,
        components: Option<usize>,
    ) -> Result<DirectionFit, DirectionError> {
        let options = DirectionOptions { components, em: few_starts(3) };
        fit_direction(&Series::whole(recording), &options, &Silent)
    }

    fn parameters(fit: &DirectionFit) -> (&[f64], &MixtureParameters) {
        match &fit.parameters {
            FamilyParameters::GmrDirection { dead_bands_counts, mixture } => {
                (dead_bands_counts, mixture)
            }
            other => panic!("{other:?}"),
        }
    }

    /// A gap: the angle follows the counts by 20 counts behind.
    fn backlash(rows: usize) -> Recording {
        let mut random = noise(1);
        let mut lagging: f64 = 0.0;
        one_motor(rows, |time| {
            let count = (600.0 * (0.7 * time).sin()).round() + (2.0 * random()).round();
            lagging = lagging.clamp(count - 20.0, count + 20.0);
            (count, 0.02 * lagging)
        })
    }

    #[test]
    fn the_branches_of_a_gap_are_found_with_a_dead_band_above_the_noise_of_the_counts() {
        let fit = fit(&backlash(2000), Some(1)).unwrap();
        let (dead_bands, mixture) = parameters(&fit);
        assert!((5.0..=50.0).contains(&dead_bands[0]), "{dead_bands:?}");
        // The regression of the angle on counts and direction: 0.02 deg per count, and 20 counts
        // behind.
        let covariance = &mixture.covariances[0];
        let [counts, direction, cross] = [covariance[0][0], covariance[1][1], covariance[0][1]];
        let [with_counts, with_direction] = [covariance[0][2], covariance[1][2]];
        let determinant = counts * direction - cross * cross;
        let slope = (direction * with_counts - cross * with_direction) / determinant;
        let behind = (counts * with_direction - cross * with_counts) / determinant;
        assert_near(slope, 0.02, 4e-4);
        assert_near(behind, -0.4, 0.05);
    }

    #[test]
    fn two_motors_get_dead_bands_of_their_own() {
        let gaps = [4.0, 40.0];
        let mut lagging = [0.0_f64; 2];
        let recording = recording(2000, |time| {
            let counts = wander(time);
            for motor in 0..2 {
                let (count, gap) = (counts[motor], gaps[motor]);
                lagging[motor] = lagging[motor].clamp(count - gap, count + gap);
            }
            (counts, straight(lagging))
        });
        let fit = fit(&recording, None).unwrap();
        let (bands, mixture) = parameters(&fit);
        assert!(bands[0] < bands[1], "{bands:?}");
        assert_eq!(mixture.means[0].len(), 6);
        assert_eq!(mixture.weights.len(), fit.components);
    }

    #[test]
    fn a_motor_that_never_turns_is_named() {
        let one_way =
            recording(400, |time| ([wander(time)[0], 10.0 * time], straight(wander(time))));
        assert_contains(&fit(&one_way, Some(1)).unwrap_err(), &["motor 1 never turns back"]);
    }
}
