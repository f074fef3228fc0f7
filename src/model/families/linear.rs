//! Affine model: `output = gain * counts + offset`, with one covariance everywhere.

use nalgebra::{SMatrix, SVector};

use crate::model::error::{ModelError, require};
use crate::model::maths::matrix_checks::{matrix, parameters, positive_semidefinite, square};
use crate::model::maths::regression::{Local, Prediction, Regression, vector};

/// A prepared affine model, in rad (m) and counts.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Linear<const D: usize, const M: usize> {
    pub gain: SMatrix<f64, M, D>,
    pub offset: SVector<f64, M>,
    pub covariance: SMatrix<f64, M, M>,
}

impl<const D: usize, const M: usize> Linear<D, M> {
    /// Checks the parameters of a file and scales its outputs by `si`.
    pub(in crate::model) fn prepare(
        gain: &[Vec<f64>],
        offset: &[f64],
        covariance: &[Vec<f64>],
        si: f64,
    ) -> Result<Self, ModelError> {
        let gain = matrix(gain, M, D, || "family.gain".to_owned())?;
        let moves_an_output = gain.iter().any(|g| *g != 0.0);
        require(
            moves_an_output,
            || "family.gain".to_owned(),
            "all 0",
            "a motor must move an output",
        )?;
        let key = || "family.offset".to_owned();
        require(
            offset.len() == M,
            key,
            format!("{} numbers", offset.len()),
            "must have one number per output",
        )?;
        parameters(offset, key)?;
        let key = || "family.covariance".to_owned();
        let covariance = square(covariance, M, key)?;
        positive_semidefinite(&covariance, key)?;
        Ok(Self {
            gain: SMatrix::from_iterator(gain.iter().copied()) * si,
            offset: vector::<M>(offset) * si,
            covariance: SMatrix::from_iterator(covariance.iter().copied()) * (si * si),
        })
    }
}

impl<const D: usize, const M: usize> Regression<D, M> for Linear<D, M> {
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M> {
        Local { mean: self.mean(input), jacobian: self.gain }
    }

    fn mean(&self, input: &SVector<f64, D>) -> SVector<f64, M> {
        self.gain * input + self.offset
    }

    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M> {
        Prediction { mean: self.mean(input), covariance: self.covariance }
    }

    /// None: the search reaches the only minimum from every start.
    fn second_start(&self, _goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        None
    }
}
