//! The drift and its uncertainty.

use i2ris::model::Model;
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS};
use i2ris_report::statistics::median;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::recording::Recording;

/// Prior standard deviations of a drift: zero in deg (mm), gain, gap.
const PRIOR: [f64; 3] = [1.5, 0.1, 0.3];

const MIN_ESTIMATE_ROWS: usize = 30;

/// Rounds of the gap scale, and its range: that of [`i2ris::model::Memory::set_gap_scale`].
const ROUNDS: usize = 5;
const GAP_SCALES: std::ops::RangeInclusive<f64> = 0.2..=3.0;

/// A number with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Value {
    pub value: f64,
    pub deviation: f64,
}

/// The drift of a robot from its calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriftEstimate {
    /// Zero of every output, in its unit.
    pub zero: Vec<Value>,
    /// Row: output; column: the calibrated output. Empty for a family without a gain matrix.
    pub gain: Vec<Vec<Value>>,
    /// Per motor, 1 as calibrated. Empty for a family without gaps.
    pub gap_scale: Vec<Value>,
    /// Root mean square length of the error before and after correction of the drift.
    pub rms: [f64; 2],
    /// Rows with a known memory.
    pub rows: usize,
    /// Share of these that count as independent.
    pub independent: f64,
    /// For figures: time, and errors before and after, of every row.
    #[serde(skip)]
    pub errors: Vec<(f64, [f64; 3], [f64; 3])>,
}

/// Why there is no estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DriftError {
    #[error("{0} rows with a known memory are too few; record at least a minute of motion")]
    Rows(usize),
    #[error("the model gives values that are not finite on this recording; recalibrate")]
    NotFinite,
}

#[derive(Debug, Clone, Copy)]
struct Shape {
    outputs: usize,
    /// Motors with a gap.
    gaps: usize,
}

impl DriftEstimate {
    /// Estimates the drift from a recording of the same robot.
    pub fn new(model: &Model, recording: &Recording) -> Result<Self, DriftError> {
        let gaps = if model.has_backlash() { model.motors() } else { 0 };
        let shape = Shape { outputs: model.outputs(), gaps };
        let used = |scale: &[f64; MAX_MOTORS]| points(model, recording, scale);
        let mut scale = [1.0; MAX_MOTORS];
        let first = used(&scale);
        if first.len() < MIN_ESTIMATE_ROWS {
            return Err(DriftError::Rows(first.len()));
        }
        let (mut now, mut solution) = (first.clone(), None);
        for _ in 0..ROUNDS {
            let found = solve(&shape.problem(&now, &scale)).ok_or(DriftError::NotFinite)?;
            let before = scale;
            let (least, most) = GAP_SCALES.into_inner();
            for (motor, scale) in scale.iter_mut().enumerate().take(shape.gaps) {
                let growth = found.parameters[shape.gap(motor)];
                *scale = (1.0 + growth).clamp(least, most);
            }
            now = used(&scale);
            solution = Some(found);
            if scale.iter().zip(before).all(|(now, then)| (now - then).abs() < 0.002) {
                break;
            }
        }
        let solution = solution.ok_or(DriftError::NotFinite)?;
        Ok(shape.estimate(&solution, &first, &now))
    }
}

impl Shape {
    fn parameters(self) -> usize {
        self.outputs + self.outputs * self.outputs + self.gaps
    }

    fn gain(self, output: usize, of: usize) -> usize {
        self.outputs + output * self.outputs + of
    }

    fn gap(self, motor: usize) -> usize {
        self.parameters() - self.gaps + motor
    }

    fn prior(self) -> DVector<f64> {
        let [zero, gain, gap] = PRIOR;
        DVector::from_fn(self.parameters(), |index, _| match index {
            index if index < self.outputs => zero,
            index if index < self.gap(0) => gain,
            _ => gap,
        })
    }

    /// The parameters are the whole drift. The predictions already contain the gaps in use.
    fn problem(self, points: &[Point], scale: &[f64; MAX_MOTORS]) -> Problem {
        let rows = points.len();
        let mut features = DMatrix::zeros(self.outputs * rows, self.parameters());
        let mut target = DVector::zeros(self.outputs * rows);
        for output in 0..self.outputs {
            for (index, point) in points.iter().enumerate() {
                let row = output * rows + index;
                features[(row, output)] = 1.0;
                for of in 0..self.outputs {
                    features[(row, self.gain(output, of))] = point.predicted[of];
                }
                target[row] = point.measured[output] - point.predicted[output];
                for motor in 0..self.gaps {
                    let slope = point.slopes[motor][output];
                    features[(row, self.gap(motor))] = slope;
                    target[row] += slope * (scale[motor] - 1.0);
                }
            }
        }
        Problem { features, target, rows, prior: self.prior() }
    }

    fn estimate(self, solution: &Solution, before: &[Point], after: &[Point]) -> DriftEstimate {
        let value = |index: usize, add: f64| Value {
            value: add + solution.parameters[index],
            deviation: solution.covariance[(index, index)].max(0.0).sqrt(),
        };
        let outputs = 0..self.outputs;
        let zero: Vec<Value> = outputs.clone().map(|output| value(output, 0.0)).collect();
        let gain_row =
            |output| (0..self.outputs).map(|of| value(self.gain(output, of), 0.0)).collect();
        let gain: Vec<Vec<Value>> = outputs.clone().map(gain_row).collect();
        let gap_scale = (0..self.gaps).map(|motor| value(self.gap(motor), 1.0)).collect();
        let errors = before.iter().zip(after).map(|(before, after)| {
            let (mut old, mut left) = ([0.0; 3], [0.0; 3]);
            for output in outputs.clone() {
                old[output] = before.measured[output] - before.predicted[output];
                let bent: f64 =
                    gain[output].iter().zip(after.predicted).map(|(g, y)| g.value * y).sum();
                let expected = after.predicted[output] + zero[output].value + bent;
                left[output] = after.measured[output] - expected;
            }
            (before.time_s, old, left)
        });
        let errors: Vec<_> = errors.collect();
        let rms = [
            length(errors.iter().map(|(_, old, _)| *old)),
            length(errors.iter().map(|(_, _, left)| *left)),
        ];
        let (rows, independent) = (errors.len(), solution.independent);
        DriftEstimate { zero, gain, gap_scale, rms, rows, independent, errors }
    }
}

pub(super) fn length(errors: impl ExactSizeIterator<Item = [f64; 3]>) -> f64 {
    let count = errors.len().max(1) as f64;
    let squares: f64 = errors.flatten().map(|error| error * error).sum();
    (squares / count).sqrt()
}

/// Relative growth of the gap for a slope.
const WIDER: f64 = 0.1;

/// A row with known memory, in the unit of the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    pub row: usize,
    /// Time, s, or the number of the row.
    pub time_s: f64,
    pub measured: [f64; MAX_OUTPUTS],
    pub predicted: [f64; MAX_OUTPUTS],
    /// Change of the prediction per growth of the gap of every motor.
    pub slopes: [[f64; MAX_OUTPUTS]; MAX_MOTORS],
}

/// Rows with known memory; all if it is never known: it then starts from the middle, as in use.
pub(super) fn points(
    model: &Model,
    recording: &Recording,
    scale: &[f64; MAX_MOTORS],
) -> Vec<Point> {
    let unit = recording.outputs()[0].unit.si();
    let mut memory = model.new_memory();
    let mut shadows = [model.new_memory(); MAX_MOTORS];
    let (mut points, mut first_known, mut next) = (Vec::new(), None, 0);
    for (index, row) in recording.rows().iter().enumerate() {
        for (counts, time_s) in recording.steps(next..row.path_index + 1) {
            memory.set_gap_scale(scale);
            model.advance_over(&mut memory, counts, time_s);
            for (motor, shadow) in shadows.iter_mut().enumerate() {
                let mut wider = *scale;
                wider[motor] += WIDER;
                shadow.set_gap_scale(&wider);
                model.advance_over(shadow, counts, time_s);
            }
        }
        next = row.path_index + 1;
        if first_known.is_none() && model.is_memory_known(&memory) {
            first_known = Some(index);
        }
        let predicted = model.predict(&row.counts, &memory).mean;
        let slope = |shadow| {
            let wider = model.predict(&row.counts, shadow).mean;
            std::array::from_fn(|output| (wider[output] - predicted[output]) / (WIDER * unit))
        };
        points.push(Point {
            row: index,
            time_s: row.time_s.unwrap_or(index as f64),
            measured: row.outputs,
            predicted: predicted.map(|value| value / unit),
            slopes: shadows.each_ref().map(slope),
        });
    }
    points.drain(..first_known.unwrap_or(0));
    points
}

/// Residuals beyond this many deviations count less, in this many rounds of weighting.
const HUBER: f64 = 1.5;
const WEIGHTINGS: usize = 6;

/// Median size of a normal variable, in its deviations.
const NORMAL_MEDIAN: f64 = 0.6745;

/// Minimum share of independent rows: a rest that does not decay shows little of its end.
const MIN_INDEPENDENT: f64 = 0.002;

/// A linear problem: `target = features parameters + rest`.
#[derive(Debug)]
struct Problem {
    /// Rows of one output follow one another, in the order of time.
    pub features: DMatrix<f64>,
    pub target: DVector<f64>,
    pub rows: usize,
    /// Deviations of the parameters around 0.
    pub prior: DVector<f64>,
}

#[derive(Debug, Clone, PartialEq)]
struct Solution {
    pub parameters: DVector<f64>,
    pub covariance: DMatrix<f64>,
    pub independent: f64,
}

/// Robust least squares with a prior. Outliers get Huber weights, iterated (P. J. Huber, "Robust
/// Estimation of a Location Parameter", 1964). Rows of a rest with the autocorrelation `a` count as
/// `(1 - a) / (1 + a)` independent ones. `None` if a number is not finite.
fn solve(problem: &Problem) -> Option<Solution> {
    let Problem { features, target, .. } = problem;
    let mut weights = DVector::from_element(target.len(), 1.0);
    let mut solution: Option<Solution> = None;
    for _ in 0..WEIGHTINGS {
        let left = match &solution {
            Some(solution) => target - features * &solution.parameters,
            None => target.clone(),
        };
        let size = median(left.abs().as_mut_slice())?;
        let deviation = (size / NORMAL_MEDIAN).max(1e-6);
        if solution.is_some() {
            weights = left.map(|left| (HUBER * deviation / left.abs().max(1e-12)).min(1.0));
        }
        let independent = independent(&left, problem.rows);
        let precision = independent / (deviation * deviation);
        let mut weighted = features.clone();
        for (mut row, weight) in weighted.row_iter_mut().zip(weights.iter()) {
            row *= *weight * precision;
        }
        let mut normal = weighted.tr_mul(features);
        for (index, prior) in problem.prior.iter().enumerate() {
            normal[(index, index)] += 1.0 / (prior * prior);
        }
        let inverse = normal.cholesky()?;
        let parameters = inverse.solve(&weighted.tr_mul(target));
        solution = Some(Solution { parameters, covariance: inverse.inverse(), independent });
    }
    solution.filter(|solution| solution.parameters.iter().all(|it| it.is_finite()))
}

/// Share of independent rows, by the largest autocorrelation of an output of `rows` rows.
fn independent(left: &DVector<f64>, rows: usize) -> f64 {
    let of_output = |rest: &[f64]| {
        let a = autocorrelation(rest).max(0.0);
        (1.0 - a) / (1.0 + a)
    };
    let outputs = left.as_slice().chunks(rows.max(1));
    outputs.map(of_output).fold(1.0, f64::min).max(MIN_INDEPENDENT)
}

/// Correlation of values with the next ones; 0 if there are none.
fn autocorrelation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let about = |value: &f64| value - mean;
    let pairs = values.iter().zip(values.iter().skip(1));
    let cross: f64 = pairs.map(|(a, b)| about(a) * about(b)).sum();
    let square: f64 = values.iter().map(|value| about(value).powi(2)).sum();
    if square > 0.0 { cross / square } else { 0.0 }
}
