//! Gaussian mixture regression.
//!
//! Source: S. Calinon, "A tutorial on task-parameterized movement learning and retrieval",
//! Intelligent Service Robotics 9 (2016), section 5.1, and the project's calibration note, whose
//! inverse of the covariance is a misprint.
//!
//! With a mixture `sum_k w_k N([x; y]; mu_k, S_k)` over inputs `x` and outputs `y`, and the blocks
//! `I` and `O`:
//!
//! ```text
//! h_k(x)  = w_k N(x; mu_k^I, S_k^I) / sum_i w_i N(x; mu_i^I, S_i^I)        responsibility
//! y_k(x)  = mu_k^O + A_k (x - mu_k^I)        A_k = S_k^OI (S_k^I)^-1       conditional mean
//! C_k     = S_k^O - A_k S_k^IO                                             conditional covariance
//! mean    = sum_k h_k y_k
//! total   = sum_k h_k (C_k + (y_k - mean) (y_k - mean)^T)                  law of total covariance
//! within  = sum_k h_k^2 C_k                                            the note's approximation
//! ```
//!
//! Derivative of the mean. `d log N(x; mu_k^I, S_k^I) / dx = -(S_k^I)^-1 (x - mu_k^I) =: g_k`,
//! hence `dh_k/dx = h_k (g_k - sum_i h_i g_i)`. Because `sum_k dh_k/dx = 0`, the conditional means
//! may be taken from any origin `o`; from that of the likeliest component, nothing cancels where
//! one component takes all:
//!
//! ```text
//! d mean / dx = sum_k h_k A_k + sum_k h_k (y_k - o) g_k^T - (mean - o) (sum_k h_k g_k)^T
//! ```
//!
//! Everything runs through the whitened distance `z_k = W_k (x - mu_k^I)` with `W_k = L_k^-1`,
//! `S_k^I = L_k L_k^T`: `log N = const - |z|^2 / 2`, `A_k = B_k W_k` with `B_k = S_k^OI W_k^T`,
//! `y_k = mu_k^O + B_k z_k`, `g_k = -W_k^T z_k`, `C_k = S_k^O - B_k B_k^T`. The responsibilities
//! are computed from logarithms relative to the largest one, so that far from all components the
//! nearest one takes over instead of 0 / 0.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use crate::model::error::{ModelError, require};
use crate::model::maths::gaussian_mixture::MixtureParameters;
use crate::model::maths::gaussian_mixture::{Component, MAX_COMPONENTS, components};
use crate::model::maths::regression::{Local, Prediction, Regression};

/// The largest entry of a whitening matrix, per count or rad (m): squared distances stay finite
/// everywhere.
const LARGEST_WHITENING: f64 = 1e12;

/// A component whose logarithm is this far below the likeliest has no share: 4e-18 of it is lost in
/// rounding.
const NEGLIGIBLE: f64 = -40.0;

/// Gaussian mixture regression of M outputs on D inputs, and the other way round from the same
/// mixture.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Gmr<const D: usize, const M: usize> {
    forward: Conditional<D, M>,
    backward: Conditional<M, D>,
}

impl<const D: usize, const M: usize> Gmr<D, M> {
    /// Checks a mixture over `[counts; outputs]` and scales its outputs by `si`.
    ///
    /// # Errors
    ///
    /// As [`components`], and when a component is too narrow to compute with.
    pub(in crate::model) fn prepare(
        mixture: &MixtureParameters,
        si: f64,
    ) -> Result<Self, ModelError> {
        let scale: Vec<f64> = (0..D).map(|_| 1.0).chain((0..M).map(|_| si)).collect();
        Self::new(&components(mixture, &scale)?)
    }

    /// From checked and scaled components over `[counts; outputs]`.
    ///
    /// # Errors
    ///
    /// When a component is too narrow to compute with.
    pub(in crate::model) fn new(components: &[Component]) -> Result<Self, ModelError> {
        Ok(Self {
            forward: Conditional::new(components, 0, D)?,
            backward: Conditional::new(components, D, 0)?,
        })
    }
}

impl<const D: usize, const M: usize> Regression<D, M> for Gmr<D, M> {
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M> {
        self.forward.local(input)
    }

    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M> {
        self.forward.predict(input)
    }

    /// The conditional mean of the inputs, given the outputs.
    fn second_start(&self, goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        Some(self.backward.local(goal).mean)
    }
}

/// The outputs given the inputs, both any part of a mixture.
#[derive(Debug, Clone, PartialEq)]
struct Conditional<const I: usize, const O: usize> {
    parts: Vec<Part<I, O>>,
}

/// What is precomputed of one component; names as at the head of this file.
#[derive(Debug, Clone, PartialEq)]
struct Part<const I: usize, const O: usize> {
    /// log w_k + log det W_k; what all components share is left out.
    log_height: f64,
    input_mean: SVector<f64, I>,
    output_mean: SVector<f64, O>,
    /// W_k.
    whitening: SMatrix<f64, I, I>,
    /// B_k.
    gain: SMatrix<f64, O, I>,
    /// A_k.
    slope: SMatrix<f64, O, I>,
    /// C_k.
    covariance: SMatrix<f64, O, O>,
}

impl<const I: usize, const O: usize> Part<I, O> {
    /// Conditions on the variables from `input` on and answers for those from `output` on.
    fn new(
        k: usize,
        component: &Component,
        input: usize,
        output: usize,
    ) -> Result<Self, ModelError> {
        let block = |row, column, height, width| {
            component
                .covariance
                .view((row, column), (height, width))
                .into_owned()
        };
        let refused = |shown: String| ModelError::Value {
            key: format!("family.mixture.covariances[{k}]"),
            value: shown,
            reason: "the component is too narrow to compute with: fit with more regularisation or \
             fewer components",
        };
        let inputs: DMatrix<f64> = block(input, input, I, I);
        let factor = inputs
            .cholesky()
            .ok_or_else(|| refused("no Cholesky factor".to_owned()))?;
        let whitening = factor
            .l()
            .try_inverse()
            .ok_or_else(|| refused("no inverse".to_owned()))?;
        if !whitening.iter().all(|w| w.abs() <= LARGEST_WHITENING) {
            return Err(refused(format!("width {:.1e}", 1.0 / whitening.amax())));
        }
        let gain = block(output, input, O, I) * whitening.transpose();
        let covariance = block(output, output, O, O) - &gain * gain.transpose();
        let log_height = component.weight.ln() + whitening.diagonal().map(f64::ln).sum();
        require(
            log_height.is_finite(),
            || format!("family.mixture.weights[{k}]"),
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

    fn whiten(&self, input: &SVector<f64, I>) -> SVector<f64, I> {
        self.whitening * (input - self.input_mean)
    }

    fn output(&self, whitened: &SVector<f64, I>) -> SVector<f64, O> {
        self.output_mean + self.gain * whitened
    }
}

impl<const I: usize, const O: usize> Conditional<I, O> {
    fn new(components: &[Component], input: usize, output: usize) -> Result<Self, ModelError> {
        let parts = components
            .iter()
            .enumerate()
            .map(|(k, component)| Part::new(k, component, input, output));
        Ok(Self {
            parts: parts.collect::<Result<_, _>>()?,
        })
    }

    fn responsibilities(&self, input: &SVector<f64, I>) -> Responsibilities<O> {
        let mut shares = [0.0; MAX_COMPONENTS];
        let mut highest = f64::NEG_INFINITY;
        let mut origin = SVector::zeros();
        for (log, part) in shares.iter_mut().zip(&self.parts) {
            let whitened = part.whiten(input);
            *log = part.log_height - 0.5 * whitened.norm_squared();
            if *log > highest {
                highest = *log;
                origin = part.output(&whitened);
            }
        }
        let mut total = 0.0;
        for (share, _) in shares.iter_mut().zip(&self.parts) {
            let below = *share - highest;
            *share = if below < NEGLIGIBLE { 0.0 } else { below.exp() };
            total += *share;
        }
        Responsibilities {
            shares,
            total,
            origin,
        }
    }

    /// The components that matter, each with its responsibility times `total`.
    fn weighted<'a>(
        &'a self,
        responsibilities: &'a Responsibilities<O>,
    ) -> impl Iterator<Item = (f64, &'a Part<I, O>)> + 'a {
        let all = responsibilities.shares.iter().zip(&self.parts);
        // Kept when it is not a number, so that such an input cannot pass for an answer.
        all.filter(|(share, _)| **share != 0.0)
            .map(|(share, part)| (*share, part))
    }

    fn local(&self, input: &SVector<f64, I>) -> Local<I, O> {
        let responsibilities = self.responsibilities(input);
        let origin = responsibilities.origin;
        let mut apart_sum = SVector::<f64, O>::zeros();
        let mut pull_sum = SVector::<f64, I>::zeros();
        let mut slope_sum = SMatrix::<f64, O, I>::zeros();
        for (share, part) in self.weighted(&responsibilities) {
            let whitened = part.whiten(input);
            let apart = part.output(&whitened) - origin;
            let pull = part.whitening.tr_mul(&whitened) * -share;
            apart_sum += apart * share;
            pull_sum += pull;
            slope_sum += part.slope * share + apart * pull.transpose();
        }
        let total = responsibilities.total;
        let apart = apart_sum / total;
        Local {
            mean: origin + apart,
            jacobian: (slope_sum - apart * pull_sum.transpose()) / total,
        }
    }

    fn predict(&self, input: &SVector<f64, I>) -> Prediction<O> {
        let responsibilities = self.responsibilities(input);
        let Responsibilities { total, origin, .. } = responsibilities;
        let mut apart_sum = SVector::<f64, O>::zeros();
        for (share, part) in self.weighted(&responsibilities) {
            apart_sum += (part.output(&part.whiten(input)) - origin) * share;
        }
        let mean = origin + apart_sum / total;
        let mut covariance = SMatrix::zeros();
        let mut covariance_within = SMatrix::zeros();
        for (share, part) in self.weighted(&responsibilities) {
            let share = share / total;
            let apart = part.output(&part.whiten(input)) - mean;
            covariance += (part.covariance + apart * apart.transpose()) * share;
            covariance_within += part.covariance * (share * share);
        }
        Prediction {
            mean,
            covariance,
            covariance_within,
        }
    }
}

/// How much every component has to say at a point.
struct Responsibilities<const O: usize> {
    /// Relative to the likeliest component, which has 1; entries beyond the last component are 0.
    shares: [f64; MAX_COMPONENTS],
    /// Sum of the shares, at least 1.
    total: f64,
    /// Conditional mean of the likeliest component.
    origin: SVector<f64, O>,
}
