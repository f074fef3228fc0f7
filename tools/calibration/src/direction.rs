//! Gaussian mixture regression on the counts and the direction of travel: its dead-bands, and its
//! mixture.
//!
//! 1. The dead-band of every motor is the one whose directions say most about the outputs: a ridge
//!    regression on cubic monomials of the counts, and on every direction times the linear ones, is
//!    tried with each and judged by blocks left out.
//! 2. A Gaussian mixture is fitted to `[counts; directions; outputs]`, a direction being 1 or -1.
//!    The number of components is chosen by leaving out contiguous blocks.

use i2ris::model::direction::{Direction, LEAST_DEAD_BAND_COUNTS, Travel};
use i2ris::model::file::FamilyParameters;
use i2ris::model::hysteresis::Lags;
use i2ris::model::hysteresis::residual::{count, features};
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec};
use nalgebra::{DMatrix, SVector};

use crate::components::choose_components;
use crate::em::{EmError, EmOptions, MixtureFit, fit_mixture};
use crate::progress::Progress;
use crate::ridge::ridge;
use crate::series::Series;
use crate::table::Table;

/// Dead-bands that are tried, counts.
const DEAD_BANDS_COUNTS: [f64; 11] = [
    LEAST_DEAD_BAND_COUNTS,
    2.0,
    3.0,
    5.0,
    8.0,
    12.0,
    20.0,
    30.0,
    50.0,
    80.0,
    120.0,
];

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
        "motor {motor} never turns back where something was measured, so the data say nothing about its direction; record \
         motion with reversals, or fit a family without directions"
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
    let components = match (options.components, series.motors()) {
        (Some(components), _) => components,
        (None, 1) => choose_components::<2>(&joint, series.outputs(), &options.em, progress),
        (None, _) => choose_components::<4>(&joint, series.outputs(), &options.em, progress),
    };
    let MixtureFit {
        parameters: mixture,
        log_likelihood,
        bic,
        ..
    } = fit_mixture(&joint, components, &options.em, progress)?;
    let dead_bands_counts = dead_bands.into_iter().take(series.motors()).collect();
    let parameters = FamilyParameters::GmrDirection {
        dead_bands_counts,
        mixture,
    };
    Ok(DirectionFit {
        parameters,
        components,
        log_likelihood,
        bic,
    })
}

/// A sample, with the directions where they are known.
struct Row {
    counts: MotorVec,
    directions: [Option<f64>; MAX_MOTORS],
    outputs: [f64; MAX_OUTPUTS],
}

impl Row {
    fn direction(&self, motor: usize) -> f64 {
        self.directions[motor].unwrap_or_default()
    }
}

/// The samples from where every direction is known.
fn rows(series: &Series, dead_bands: &MotorVec) -> Vec<Row> {
    let Some(first) = series.path().first() else {
        return Vec::new();
    };
    let mut travels = first.map(Travel::begin);
    let mut next = 0;
    let mut rows = Vec::with_capacity(series.samples().len());
    for sample in series.samples() {
        for counts in series.path().get(next..=sample.place).unwrap_or_default() {
            for (motor, travel) in travels.iter_mut().enumerate() {
                *travel = travel.advanced(counts[motor], dead_bands[motor]);
            }
        }
        next = sample.place + 1;
        let counts = series.path()[sample.place];
        let directions = travels.map(|travel| travel.direction().variable());
        rows.push(Row {
            counts,
            directions,
            outputs: sample.outputs,
        });
    }
    rows.retain(|row| {
        row.directions
            .iter()
            .take(series.motors())
            .all(Option::is_some)
    });
    rows
}

fn every_motor_turns(rows: &[Row], motors: usize) -> Result<(), DirectionError> {
    let goes = |motor: usize, way: Direction| {
        rows.iter()
            .any(|row| row.directions[motor] == way.variable())
    };
    let turns = |motor: &usize| goes(*motor, Direction::Up) && goes(*motor, Direction::Down);
    (0..motors)
        .find(|motor| !turns(motor))
        .map_or(Ok(()), |motor| Err(DirectionError::NeverTurns { motor }))
}

fn joint(rows: &[Row], series: &Series) -> Table {
    let (motors, outputs) = (series.motors(), series.outputs());
    let cells = |row: &Row| {
        let directions = (0..motors).map(|motor| row.direction(motor));
        let counts = row.counts.into_iter().take(motors);
        counts
            .chain(directions)
            .chain(row.outputs.into_iter().take(outputs))
            .collect::<Vec<_>>()
    };
    Table::from_rows(2 * motors + outputs, rows.iter().map(cells))
}

/// The best dead-band for all motors together, and then for each by itself.
fn choose_dead_bands(series: &Series) -> MotorVec {
    let ranges = ranges(series);
    let fits =
        |motor: usize, band: f64| band <= (WIDEST * ranges[motor]).max(LEAST_DEAD_BAND_COUNTS);
    let best = |candidates: Vec<MotorVec>| {
        let judged = candidates
            .into_iter()
            .filter_map(|bands| Some((left_out_error(series, &bands)?, bands)));
        judged
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, bands)| bands)
    };
    let together = DEAD_BANDS_COUNTS
        .into_iter()
        .filter(|band| (0..series.motors()).all(|motor| fits(motor, *band)));
    let together = best(together.map(|band| [band; MAX_MOTORS]).collect());
    let mut bands = together.unwrap_or([LEAST_DEAD_BAND_COUNTS; MAX_MOTORS]);
    for motor in 0..if series.motors() == 1 {
        0
    } else {
        series.motors()
    } {
        let one = |band: f64| {
            let mut bands = bands;
            bands[motor] = band;
            bands
        };
        let candidates = DEAD_BANDS_COUNTS
            .into_iter()
            .filter(|band| fits(motor, *band))
            .map(one)
            .collect();
        bands = best(candidates).unwrap_or(bands);
    }
    bands
}

fn ranges(series: &Series) -> MotorVec {
    let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; MAX_MOTORS];
    for counts in series.path() {
        for ([low, high], at) in ends.iter_mut().zip(counts) {
            (*low, *high) = (low.min(*at), high.max(*at));
        }
    }
    ends.map(|[low, high]| high - low)
}

/// Mean squared error of the ridge regression on blocks left out; `None` where the rows do not
/// determine it.
fn left_out_error(series: &Series, dead_bands: &MotorVec) -> Option<f64> {
    let mut rows = rows(series, dead_bands);
    let step = rows.len().div_ceil(CHOICE_ROWS).max(1);
    rows = rows.into_iter().step_by(step).collect();
    let features = if series.motors() == 1 {
        regressors::<1>(&rows)
    } else {
        regressors::<2>(&rows)
    };
    let outputs = DMatrix::from_fn(rows.len(), series.outputs(), |row, output| {
        rows[row].outputs[output]
    });
    (rows.len() > features.ncols())
        .then(|| ridge(&features, &outputs))
        .flatten()
        .map(|fit| fit.left_out_error)
}

fn regressors<const D: usize>(rows: &[Row]) -> DMatrix<f64> {
    let scale = rows
        .iter()
        .flat_map(|row| row.counts)
        .fold(1.0, |scale: f64, count| scale.max(count.abs()));
    let mut matrix = DMatrix::zeros(rows.len(), count::<D>(DEGREES.0, DEGREES.1, D));
    for (mut cells, row) in matrix.row_iter_mut().zip(rows) {
        let mut directions = Lags::default();
        (0..D).for_each(|motor| directions.push(row.direction(motor)));
        let scaled = SVector::<f64, D>::from_fn(|motor, _| row.counts[motor] / scale);
        let mut cells = cells.iter_mut();
        features(&scaled, &directions, DEGREES.0, DEGREES.1, |feature| {
            if let Some(cell) = cells.next() {
                *cell = feature;
            }
        });
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::recording::Recording;
    use crate::testing::{noise, one_motor, recording, straight, wander};

    fn series(recording: &Recording) -> Series {
        Series::new(recording, &(0..recording.rows().len()).collect::<Vec<_>>())
    }

    fn options(components: Option<usize>) -> DirectionOptions {
        DirectionOptions {
            components,
            em: EmOptions {
                restarts: 3,
                ..EmOptions::default()
            },
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
    fn the_branches_of_a_gap_are_found_with_a_dead_band_that_bears_the_flicker() {
        let fit = fit_direction(&series(&backlash(2000)), &options(Some(1)), &Silent).unwrap();
        let FamilyParameters::GmrDirection {
            dead_bands_counts,
            mixture,
        } = &fit.parameters
        else {
            panic!()
        };
        assert!(
            (5.0..=50.0).contains(&dead_bands_counts[0]),
            "{dead_bands_counts:?}"
        );
        // Of the regression of the angle on counts and direction: 0.02 deg per count, and 20 counts
        // behind.
        let [counts, direction, cross] =
            [(0, 0), (1, 1), (0, 1)].map(|(i, j)| mixture.covariances[0][i][j]);
        let [with_counts, with_direction] =
            [mixture.covariances[0][0][2], mixture.covariances[0][1][2]];
        let determinant = counts * direction - cross * cross;
        let slope = (direction * with_counts - cross * with_direction) / determinant;
        let behind = (counts * with_direction - cross * with_counts) / determinant;
        assert!((slope - 0.02).abs() < 4e-4, "{slope}");
        assert!((behind + 0.4).abs() < 0.05, "{behind}");
    }

    #[test]
    fn two_motors_get_dead_bands_of_their_own() {
        let gaps = [4.0, 40.0];
        let mut lagging = [0.0_f64; 2];
        let recording = recording(2000, |time| {
            let counts = wander(time);
            for motor in 0..2 {
                lagging[motor] =
                    lagging[motor].clamp(counts[motor] - gaps[motor], counts[motor] + gaps[motor]);
            }
            (counts, straight(lagging))
        });
        let fit = fit_direction(&series(&recording), &options(None), &Silent).unwrap();
        let FamilyParameters::GmrDirection {
            dead_bands_counts: bands,
            mixture,
        } = &fit.parameters
        else {
            panic!()
        };
        assert!(bands[0] < bands[1], "{bands:?}");
        assert_eq!(
            (mixture.means[0].len(), mixture.weights.len()),
            (6, fit.components)
        );
    }

    #[test]
    fn a_motor_that_never_turns_is_named() {
        let recording = recording(400, |time| {
            ([wander(time)[0], 10.0 * time], straight(wander(time)))
        });
        let error = fit_direction(&series(&recording), &options(Some(1)), &Silent).unwrap_err();
        assert!(
            error.to_string().contains("motor 1 never turns back"),
            "{error}"
        );
    }
}
