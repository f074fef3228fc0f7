//! One component of a mixture, prepared for the regression.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use crate::model::error::{ModelError, require};
use crate::model::maths::gaussian_mixture::Component;

/// The largest entry of a whitening matrix, per count or rad (m). It keeps squared distances finite
/// everywhere.
const MAX_WHITENING: f64 = 1e12;

/// The precomputed terms of one component. [`super::gaussian_mixture_regression`]
/// defines the symbols.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Part<const I: usize, const O: usize> {
    /// log w_k + log det W_k, without the constant that all components share.
    pub log_height: f64,
    pub input_mean: SVector<f64, I>,
    pub output_mean: SVector<f64, O>,
    /// W_k.
    pub whitening: SMatrix<f64, I, I>,
    /// B_k.
    pub gain: SMatrix<f64, O, I>,
    /// A_k.
    pub slope: SMatrix<f64, O, I>,
    /// C_k.
    pub covariance: SMatrix<f64, O, O>,
}

impl<const I: usize, const O: usize> Part<I, O> {
    /// Conditions on the I variables from `input` on, and predicts the O variables from `output`
    /// on. `name` is that of the mixture in the file.
    pub(super) fn new(
        k: usize,
        component: &Component,
        input: usize,
        output: usize,
        name: &str,
    ) -> Result<Self, ModelError> {
        let block = |row, column, height, width| {
            component.covariance.view((row, column), (height, width)).into_owned()
        };
        let refused = |shown: String| ModelError::Value {
            key: format!("{name}.covariances[{k}]"),
            value: shown,
            reason: "the component is too narrow to compute with: fit with more regularisation or \
             fewer components",
        };
        let inputs: DMatrix<f64> = block(input, input, I, I);
        let factor = inputs.cholesky().ok_or_else(|| refused("no Cholesky factor".to_owned()))?;
        let whitening = factor.l().try_inverse().ok_or_else(|| refused("no inverse".to_owned()))?;
        if !whitening.iter().all(|w| w.abs() <= MAX_WHITENING) {
            return Err(refused(format!("width {:.1e}", 1.0 / whitening.amax())));
        }
        let gain = block(output, input, O, I) * whitening.transpose();
        let covariance = block(output, output, O, O) - &gain * gain.transpose();
        let log_height = component.weight.ln() + whitening.diagonal().map(f64::ln).sum();
        require(
            log_height.is_finite(),
            || format!("{name}.weights[{k}]"),
            component.weight,
            "is too small",
        )?;
        let part = |mean: &DVector<f64>, from, count| mean.rows(from, count).into_owned();
        Ok(Self {
            log_height,
            input_mean: SVector::from_iterator(part(&component.mean, input, I).iter().copied()),
            output_mean: SVector::from_iterator(part(&component.mean, output, O).iter().copied()),
            whitening: SMatrix::from_iterator(whitening.iter().copied()),
            slope: SMatrix::from_iterator((&gain * &whitening).iter().copied()),
            gain: SMatrix::from_iterator(gain.iter().copied()),
            covariance: SMatrix::from_iterator(covariance.iter().copied()),
        })
    }
}
