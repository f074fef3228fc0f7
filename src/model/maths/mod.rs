//! The mathematics of models: convex regions, mixtures, regression and its inverse; here regression
//! on vectors of static size, and conversion to arrays of fixed size.

pub(in crate::model) mod gaussian_mixture;
pub(in crate::model) mod gaussian_mixture_regression;
pub(in crate::model) mod hull;
pub(in crate::model) mod matrix_checks;
pub(in crate::model) mod mixture_regression;
pub(in crate::model) mod newton_inverse;
pub(in crate::model) mod plane;
pub mod polynomial_regression;

use std::fmt::Debug;

use nalgebra::{SMatrix, SVector};

use crate::model::estimate::Estimate;
use crate::units::MotorVec;
use hull::MAX_COUNTS;

/// Exponential of a number up to 0; 0 below `least`; NaN for NaN. Computed by `libm` instead of the
/// system library: it gives the same bits everywhere.
#[inline]
pub(in crate::model) fn exp_above(x: f64, least: f64) -> f64 {
    if x < least { 0.0 } else { libm::exp(x) }
}

/// A regression of M outputs, rad (m), on D inputs, counts.
pub(in crate::model) trait Regression<const D: usize, const M: usize>:
    Debug + Send + Sync
{
    /// Mean and Jacobian, for the inverse.
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M>;

    fn mean(&self, input: &SVector<f64, D>) -> SVector<f64, M>;

    /// Mean and covariance.
    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M>;

    /// A second start of the search for the input of a goal, for use when the first start does not
    /// reach the goal.
    fn second_start(&self, goal: &SVector<f64, M>) -> Option<SVector<f64, D>>;
}

/// Mean and slope of a regression at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Local<const D: usize, const M: usize> {
    /// The outputs.
    pub mean: SVector<f64, M>,
    /// d mean / d input.
    pub jacobian: SMatrix<f64, M, D>,
}

/// Mean and spread of a regression at a point; see [`Estimate`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) struct Prediction<const M: usize> {
    pub mean: SVector<f64, M>,
    pub covariance: SMatrix<f64, M, M>,
}

/// A prediction in arrays of fixed size.
pub(in crate::model) fn estimate<const M: usize>(prediction: &Prediction<M>) -> Estimate {
    Estimate { mean: array(&prediction.mean), covariance: rows(&prediction.covariance) }
}

/// Clamps counts to the range of a drive, so that squares do not overflow.
pub(in crate::model) fn bounded(counts: &MotorVec) -> MotorVec {
    counts.map(|c| c.clamp(-MAX_COUNTS, MAX_COUNTS))
}

/// Converts the first entries of an array to a vector.
#[inline]
pub(in crate::model) fn vector<const N: usize>(array: &[f64]) -> SVector<f64, N> {
    SVector::from_fn(|i, _| array.get(i).copied().unwrap_or_default())
}

/// Converts a vector to an array of fixed size, padded with 0.
#[inline]
pub(in crate::model) fn array<const N: usize, const F: usize>(
    vector: &SVector<f64, N>,
) -> [f64; F] {
    let mut array = [0.0; F];
    for (to, from) in array.iter_mut().zip(vector.iter()) {
        *to = *from;
    }
    array
}

/// Converts a matrix to rows of fixed size, padded with 0.
pub(in crate::model) fn rows<const R: usize, const C: usize, const FR: usize, const FC: usize>(
    matrix: &SMatrix<f64, R, C>,
) -> [[f64; FC]; FR] {
    let mut rows = [[0.0; FC]; FR];
    for (row, from) in rows.iter_mut().zip(matrix.row_iter()) {
        for (to, from) in row.iter_mut().zip(from.iter()) {
            *to = *from;
        }
    }
    rows
}
