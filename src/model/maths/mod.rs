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
pub(in crate::model) mod wide;
