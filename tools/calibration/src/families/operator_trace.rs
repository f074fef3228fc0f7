//! Hysteresis operators along the path of a series. Callers do not depend on the number of motors.

use i2ris::model::ModelError;
use i2ris::model::hysteresis::backlash_play::{PlayParameters, Plays};
use i2ris::model::hysteresis::residual::{count, features};
use i2ris::model::hysteresis::{Lags, Operator};
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use i2ris_report::statistics::min_max;
use nalgebra::{DMatrix, SVector};

use crate::series::{Sample, Series};

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
        let counts = samples.iter().map(|sample| series.counts(sample)[motor]);
        let (low, high) = min_max(counts);
        high - low
    };
    let (all, rest) = (series.samples(), &series.samples()[first..]);
    (0..series.motors()).all(|motor| range(rest, motor) >= MIN_COVERAGE * range(all, motor))
}

/// A row of residual features per sample: monomials of the scaled counts up to the first degree,
/// then each of `lags` lags times the monomials up to the second degree. `row` returns the scaled
/// counts and the lags of a sample.
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

/// Number of features without lags.
pub(crate) fn shape_features(motors: usize, degree: usize) -> usize {
    match motors {
        1 => count::<1>(degree, 0, 0),
        _ => count::<2>(degree, 0, 0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::one_motor;

    fn trace(series: &Series, threshold: f64) -> Vec<TracePoint> {
        let plays = PlayParameters {
            thresholds_counts: vec![vec![0.0, threshold]],
            weights: vec![vec![0.5, 0.5]],
            planar_thresholds_counts: Vec::new(),
        };
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
