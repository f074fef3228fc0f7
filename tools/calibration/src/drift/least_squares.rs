//! Robust least squares with a prior.
//!
//! Outliers: Huber weights, iterated (P. J. Huber, "Robust Estimation of a Location Parameter",
//! 1964). Rows of a rest with the autocorrelation `a` count as `(1 - a) / (1 + a)` independent
//! ones.

use i2ris_report::statistics::median;
use nalgebra::{DMatrix, DVector};

/// Rounds of weighting.
const ROUNDS: usize = 6;

/// Residuals beyond this many deviations count less.
const HUBER: f64 = 1.5;

/// The median of the absolute value of a normal variable, in its deviations.
const NORMAL_MEDIAN: f64 = 0.6745;

/// Minimum share of independent rows: a rest that does not decay within a recording shows little of
/// its end.
const MIN_INDEPENDENT: f64 = 0.002;

/// A linear problem: `target = features parameters + rest`.
#[derive(Debug)]
pub(super) struct Problem {
    /// Rows of one output follow one another, in the order of time.
    pub features: DMatrix<f64>,
    pub target: DVector<f64>,
    /// Rows of each output.
    pub rows: usize,
    /// Deviations of the parameters around 0.
    pub prior: DVector<f64>,
}

/// Parameters with their covariance.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Solution {
    pub parameters: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// Share of the rows that count as independent.
    pub independent: f64,
}

/// The fit. `None` if the equations cannot be solved: a number is not finite.
pub(super) fn solve(problem: &Problem) -> Option<Solution> {
    let Problem { features, target, .. } = problem;
    let mut weights = DVector::from_element(target.len(), 1.0);
    let mut solution: Option<Solution> = None;
    for _ in 0..ROUNDS {
        let left = match &solution {
            Some(solution) => target - features * &solution.parameters,
            None => target.clone(),
        };
        let mut sizes: Vec<f64> = left.iter().map(|left| left.abs()).collect();
        let deviation = (median(&mut sizes)? / NORMAL_MEDIAN).max(1e-6);
        if solution.is_some() {
            weights = left.map(|left| (HUBER * deviation / left.abs().max(1e-12)).min(1.0));
        }
        let independent = problem.independent(&left);
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
        solution = Some(Solution {
            parameters: inverse.solve(&weighted.tr_mul(target)),
            covariance: inverse.inverse(),
            independent,
        });
    }
    solution.filter(|solution| solution.parameters.iter().all(|it| it.is_finite()))
}

impl Problem {
    /// Share from the autocorrelation from row to row, of the output with the largest value.
    fn independent(&self, left: &DVector<f64>) -> f64 {
        let of_output = |rest: &[f64]| {
            let a = autocorrelation(rest).max(0.0);
            (1.0 - a) / (1.0 + a)
        };
        let outputs = left.as_slice().chunks(self.rows.max(1));
        outputs.map(of_output).fold(1.0, f64::min).max(MIN_INDEPENDENT)
    }
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
