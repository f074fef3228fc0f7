//! A Gaussian mixture conditioned on some of its variables.
//!
//! For a component with blocks `s` (known) and `r` (remaining):
//!
//! ```text
//! weight ~ w N(s; mu_s, S_ss)
//! mean   = mu_r + S_rs S_ss^-1 (s - mu_s)
//! cov    = S_rr - S_rs S_ss^-1 S_sr
//! ```
//!
//! Regression on the conditioned mixture equals regression on the whole mixture with these inputs
//! held constant.

use nalgebra::{DMatrix, DVector};

use crate::model::maths::gaussian_mixture::Component;

/// A component whose log-weight is this far below the largest is left out: its weight is close to
/// the least positive number.
const LEAST_LOG_WEIGHT: f64 = -600.0;

/// The mixture of the variables in `remaining`, given the values of the variables in `known`.
/// Without known variables it is the marginal. `None` if a covariance is not positive definite.
pub(in crate::model) fn condition(
    components: &[Component],
    remaining: &[usize],
    known: &[(usize, f64)],
) -> Option<Vec<Component>> {
    let known_indices: Vec<usize> = known.iter().map(|(index, _)| *index).collect();
    let values = DVector::from_iterator(known.len(), known.iter().map(|(_, value)| *value));
    let conditioned: Option<Vec<_>> = components
        .iter()
        .map(|component| condition_one(component, remaining, &known_indices, &values))
        .collect();
    let mut conditioned = conditioned?;
    let highest =
        conditioned.iter().map(|(log_weight, _)| *log_weight).fold(f64::NEG_INFINITY, f64::max);
    conditioned.retain(|(log_weight, _)| log_weight - highest > LEAST_LOG_WEIGHT);
    let total: f64 = conditioned.iter().map(|(log_weight, _)| (log_weight - highest).exp()).sum();
    let weighted = |(log_weight, component): (f64, Component)| Component {
        weight: (log_weight - highest).exp() / total,
        ..component
    };
    Some(conditioned.into_iter().map(weighted).collect())
}

/// The logarithm of the weight, without the constant that all components share, and the conditioned
/// component. Its weight is not valid yet.
fn condition_one(
    component: &Component,
    remaining: &[usize],
    known: &[usize],
    values: &DVector<f64>,
) -> Option<(f64, Component)> {
    let mean = component.mean.select_rows(remaining);
    let covariance = block(&component.covariance, remaining, remaining);
    let log_weight = component.weight.ln();
    if known.is_empty() {
        return Some((log_weight, Component { weight: component.weight, mean, covariance }));
    }
    let factor = block(&component.covariance, known, known).cholesky()?;
    let difference = values - component.mean.select_rows(known);
    let cross = block(&component.covariance, remaining, known);
    let distance = difference.dot(&factor.solve(&difference));
    let log_density = -0.5 * (distance + factor.determinant().ln());
    let gain = factor.solve(&cross.transpose()).transpose();
    let narrowed = covariance - &gain * cross.transpose();
    let symmetric = (&narrowed + narrowed.transpose()) * 0.5;
    let component = Component {
        weight: component.weight,
        mean: mean + gain * difference,
        covariance: symmetric,
    };
    Some((log_weight + log_density, component))
}

fn block(matrix: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    matrix.select_rows(rows).select_columns(columns)
}
