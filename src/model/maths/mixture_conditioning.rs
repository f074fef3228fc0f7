//! A mixture with some of its variables known.
//!
//! For a component with blocks `s` (known) and `r` (the rest):
//!
//! ```text
//! weight ~ w N(s; mu_s, S_ss)
//! mean   = mu_r + S_rs S_ss^-1 (s - mu_s)
//! cov    = S_rr - S_rs S_ss^-1 S_sr
//! ```
//!
//! Regression on the conditioned mixture is regression on the whole one with these inputs held
//! fast.

use nalgebra::{DMatrix, DVector};

use crate::model::maths::gaussian_mixture::Component;

/// A component whose weight is this far below the largest, as a logarithm, is left out: about where
/// numbers end.
const LEAST_LOG_WEIGHT: f64 = -600.0;

/// The mixture of the variables in `rest`, given the values of those in `known`; without any known
/// it is the marginal. `None` where a covariance is not positive definite.
pub(in crate::model) fn condition(
    components: &[Component],
    rest: &[usize],
    known: &[(usize, f64)],
) -> Option<Vec<Component>> {
    let places: Vec<usize> = known.iter().map(|(place, _)| *place).collect();
    let values = DVector::from_iterator(known.len(), known.iter().map(|(_, value)| *value));
    let conditioned: Option<Vec<_>> = components
        .iter()
        .map(|component| condition_one(component, rest, &places, &values))
        .collect();
    let mut conditioned = conditioned?;
    let highest = conditioned
        .iter()
        .map(|(log_weight, _)| *log_weight)
        .fold(f64::NEG_INFINITY, f64::max);
    conditioned.retain(|(log_weight, _)| log_weight - highest > LEAST_LOG_WEIGHT);
    let total: f64 = conditioned
        .iter()
        .map(|(log_weight, _)| (log_weight - highest).exp())
        .sum();
    let weighted = |(log_weight, component): (f64, Component)| Component {
        weight: (log_weight - highest).exp() / total,
        ..component
    };
    Some(conditioned.into_iter().map(weighted).collect())
}

/// The logarithm of the weight up to what all components share, and the component with its weight
/// left to fill in.
fn condition_one(
    component: &Component,
    rest: &[usize],
    known: &[usize],
    values: &DVector<f64>,
) -> Option<(f64, Component)> {
    let mean = component.mean.select_rows(rest);
    let covariance = block(&component.covariance, rest, rest);
    let log_weight = component.weight.ln();
    if known.is_empty() {
        return Some((
            log_weight,
            Component {
                weight: component.weight,
                mean,
                covariance,
            },
        ));
    }
    let factor = block(&component.covariance, known, known).cholesky()?;
    let apart = values - component.mean.select_rows(known);
    let cross = block(&component.covariance, rest, known);
    let distance = apart.dot(&factor.solve(&apart));
    let log_density = -0.5 * (distance + factor.determinant().ln());
    let gain = factor.solve(&cross.transpose()).transpose();
    let narrowed = covariance - &gain * cross.transpose();
    let symmetric = (&narrowed + narrowed.transpose()) * 0.5;
    let component = Component {
        weight: component.weight,
        mean: mean + gain * apart,
        covariance: symmetric,
    };
    Some((log_weight + log_density, component))
}

fn block(matrix: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    matrix.select_rows(rows).select_columns(columns)
}
