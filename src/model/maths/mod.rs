//! The mathematics of models: convex regions, mixtures, regression and its inverse.

pub(in crate::model) mod gaussian_mixture;
pub(in crate::model) mod gaussian_mixture_regression;
pub(in crate::model) mod hull;
pub(in crate::model) mod matrix_checks;
mod mixture_part;
pub(in crate::model) mod mixture_regression;
pub(in crate::model) mod newton_inverse;
pub(in crate::model) mod polygon;
pub mod polynomial_regression;
pub(in crate::model) mod quadratic;
pub(in crate::model) mod regression;

/// Exponential of a number up to 0; 0 below `least`; NaN for NaN. Computed by `libm` instead of the
/// system library: it gives the same bits everywhere.
pub(in crate::model) fn exp_above(x: f64, least: f64) -> f64 {
    if x < least { 0.0 } else { libm::exp(x) }
}
