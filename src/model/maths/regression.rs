//! What every family computes, in vectors of its own size, and the bridge to arrays of fixed size.

use std::fmt::Debug;

use nalgebra::{SMatrix, SVector};

use crate::model::error::ModelError;
use crate::model::estimate::{Estimate, Inverse, JacobianMatrix, Query};
use crate::model::file::OutputUnit;
use crate::model::maths::hull::{Hull, MAX_COUNTS};
use crate::model::families::memory::Memory;
use crate::model::families::round_trip;
use crate::model::maths::newton_inverse as inverse;
use crate::units::{MotorVec, OutputVec};

/// A regression of M outputs, rad (m), on D inputs, counts.
pub(in crate::model) trait Regression<const D: usize, const M: usize>: Debug + Send + Sync {
    /// Mean and Jacobian: what the inverse needs.
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M>;

    /// Mean and both covariances.
    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M>;

    /// Where else to start the search for the input of a goal, if its first start leads nowhere.
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
    pub covariance_within: SMatrix<f64, M, M>,
}

/// A family behind a door of fixed size: the one place where sizes become types. What a family
/// without memory leaves out is the right thing for it.
pub(in crate::model) trait Runtime: Debug + Send + Sync {
    /// Brings the state of a memory, whose position has been noted, to that position.
    fn advance(&self, _memory: &mut Memory, _counts: &MotorVec) {}

    /// The range that every motor has to cover to wipe out what was remembered before, counts.
    fn wipe_counts(&self) -> MotorVec {
        MotorVec::default()
    }

    /// See [`crate::model::Model::correction`].
    fn correction(&self, _memory: &Memory) -> OutputVec {
        OutputVec::default()
    }

    /// See [`crate::model::Model::virtual_counts`].
    fn virtual_counts(&self, counts: &MotorVec, _memory: &Memory) -> MotorVec {
        bounded(counts)
    }

    fn predict(&self, counts: &MotorVec, memory: &Memory) -> Estimate;
    fn jacobian(&self, counts: &MotorVec, memory: &Memory) -> JacobianMatrix;
    fn invert(&self, goal: &OutputVec, memory: &Memory, hull: &Hull, query: &Query) -> Inverse;
    /// See [`round_trip::check`].
    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError>;
}

/// Gives a regression on the counts, of sizes `D` and `M` the door of fixed size.
#[derive(Debug)]
pub(in crate::model) struct Prepared<R, const D: usize, const M: usize>(pub R);

impl<R: Regression<D, M>, const D: usize, const M: usize> Runtime for Prepared<R, D, M> {
    fn predict(&self, counts: &MotorVec, _memory: &Memory) -> Estimate {
        estimate(&self.0.predict(&vector(&bounded(counts))))
    }

    fn jacobian(&self, counts: &MotorVec, _memory: &Memory) -> JacobianMatrix {
        rows(&self.0.local(&vector(&bounded(counts))).jacobian)
    }

    fn invert(&self, goal: &OutputVec, _memory: &Memory, hull: &Hull, query: &Query) -> Inverse {
        inverse::invert(&self.0, hull, goal, &query.start)
    }

    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError> {
        let local = |counts: &MotorVec| Some(self.0.local(&vector::<D>(counts)));
        round_trip::check(hull, unit, local, |goal| {
            inverse::invert(&self.0, hull, goal, &hull.centre())
        })
    }
}

/// A prediction in arrays of fixed size.
pub(in crate::model) fn estimate<const M: usize>(prediction: &Prediction<M>) -> Estimate {
    Estimate {
        mean: array(&prediction.mean),
        covariance: rows(&prediction.covariance),
        covariance_within: rows(&prediction.covariance_within),
    }
}

/// Keeps squares from overflowing; no drive reports more.
pub(in crate::model) fn bounded(counts: &MotorVec) -> MotorVec {
    counts.map(|c| c.clamp(-MAX_COUNTS, MAX_COUNTS))
}

/// The first entries of an array of fixed size.
pub(in crate::model) fn vector<const N: usize>(array: &[f64]) -> SVector<f64, N> {
    let mut vector = SVector::<f64, N>::zeros();
    vector
        .iter_mut()
        .zip(array)
        .for_each(|(to, from)| *to = *from);
    vector
}

/// A vector in an array of fixed size, filled up with 0.
pub(in crate::model) fn array<const N: usize, const F: usize>(vector: &SVector<f64, N>) -> [f64; F] {
    let mut array = [0.0; F];
    array
        .iter_mut()
        .zip(vector.iter())
        .for_each(|(to, from)| *to = *from);
    array
}

/// A matrix as rows of fixed size, filled up with 0.
pub(in crate::model) fn rows<const R: usize, const C: usize, const FR: usize, const FC: usize>(
    matrix: &SMatrix<f64, R, C>,
) -> [[f64; FC]; FR] {
    let mut rows = [[0.0; FC]; FR];
    for (row, from) in rows.iter_mut().zip(matrix.row_iter()) {
        row.iter_mut()
            .zip(from.iter())
            .for_each(|(to, from)| *to = *from);
    }
    rows
}
