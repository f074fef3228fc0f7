//! What every family computes, in vectors of its own size, and the bridge to arrays of fixed size.

use std::fmt::Debug;

use nalgebra::{SMatrix, SVector};

use super::error::ModelError;
use super::estimate::{Estimate, Inverse, JacobianMatrix};
use super::file::OutputUnit;
use super::hull::{Hull, MAX_COUNTS};
use super::{inverse, round_trip};
use crate::units::{MotorVec, OutputVec};

/// A regression of M outputs, rad (m), on D inputs, counts.
pub(super) trait Regression<const D: usize, const M: usize>: Debug + Send + Sync {
    /// Mean and Jacobian: what the inverse needs.
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M>;

    /// Mean and both covariances.
    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M>;

    /// Where else to start the search for the input of a goal, if its first start leads nowhere.
    fn second_start(&self, goal: &SVector<f64, M>) -> Option<SVector<f64, D>>;
}

/// Mean and slope of a regression at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Local<const D: usize, const M: usize> {
    pub mean: SVector<f64, M>,
    /// d mean / d input.
    pub jacobian: SMatrix<f64, M, D>,
}

/// Mean and spread of a regression at a point; see [`Estimate`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Prediction<const M: usize> {
    pub mean: SVector<f64, M>,
    pub covariance: SMatrix<f64, M, M>,
    pub covariance_within: SMatrix<f64, M, M>,
}

/// A regression behind a door of fixed size: the one place where sizes become types.
pub(super) trait Runtime: Debug + Send + Sync {
    fn predict(&self, counts: &MotorVec) -> Estimate;
    fn jacobian(&self, counts: &MotorVec) -> JacobianMatrix;
    fn invert(&self, goal: &OutputVec, hull: &Hull, start: &MotorVec) -> Inverse;
    /// See [`round_trip::check`].
    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError>;
}

/// Gives a regression of sizes `D` and `M` the door of fixed size.
#[derive(Debug)]
pub(super) struct Prepared<R, const D: usize, const M: usize>(pub R);

impl<R: Regression<D, M>, const D: usize, const M: usize> Runtime for Prepared<R, D, M> {
    fn predict(&self, counts: &MotorVec) -> Estimate {
        let prediction = self.0.predict(&vector(&bounded(counts)));
        Estimate {
            mean: array(&prediction.mean),
            covariance: rows(&prediction.covariance),
            covariance_within: rows(&prediction.covariance_within),
        }
    }

    fn jacobian(&self, counts: &MotorVec) -> JacobianMatrix {
        rows(&self.0.local(&vector(&bounded(counts))).jacobian)
    }

    fn invert(&self, goal: &OutputVec, hull: &Hull, start: &MotorVec) -> Inverse {
        inverse::invert(&self.0, hull, goal, start)
    }

    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError> {
        round_trip::check(&self.0, hull, unit)
    }
}

/// Keeps squares from overflowing; no drive reports more.
fn bounded(counts: &MotorVec) -> MotorVec {
    counts.map(|c| c.clamp(-MAX_COUNTS, MAX_COUNTS))
}

/// The first entries of an array of fixed size.
pub(super) fn vector<const N: usize>(array: &[f64]) -> SVector<f64, N> {
    let mut vector = SVector::<f64, N>::zeros();
    vector.iter_mut().zip(array).for_each(|(to, from)| *to = *from);
    vector
}

/// A vector in an array of fixed size, filled up with 0.
pub(super) fn array<const N: usize, const F: usize>(vector: &SVector<f64, N>) -> [f64; F] {
    let mut array = [0.0; F];
    array.iter_mut().zip(vector.iter()).for_each(|(to, from)| *to = *from);
    array
}

/// A matrix as rows of fixed size, filled up with 0.
pub(super) fn rows<const R: usize, const C: usize, const FR: usize, const FC: usize>(
    matrix: &SMatrix<f64, R, C>,
) -> [[f64; FC]; FR] {
    let mut rows = [[0.0; FC]; FR];
    for (row, from) in rows.iter_mut().zip(matrix.row_iter()) {
        row.iter_mut().zip(from.iter()).for_each(|(to, from)| *to = *from);
    }
    rows
}
