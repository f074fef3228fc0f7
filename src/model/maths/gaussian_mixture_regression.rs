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
//! may be taken from any origin `o`. With the conditional mean of the likeliest component as the
//! origin, there is no cancellation where one component has the whole responsibility:
//!
//! ```text
//! d mean / dx = sum_k h_k A_k + sum_k h_k (y_k - o) g_k^T - (mean - o) (sum_k h_k g_k)^T
//! ```
//!
//! All terms use the whitened distance `z_k = W_k (x - mu_k^I)` with `W_k = L_k^-1`, `S_k^I = L_k
//! L_k^T`: `log N = const - |z|^2 / 2`, `A_k = B_k W_k` with `B_k = S_k^OI W_k^T`, `y_k = mu_k^O +
//! B_k z_k`, `g_k = -W_k^T z_k`, `C_k = S_k^O - B_k B_k^T`. The responsibilities are computed from
//! logarithms relative to the largest one. Far from all components the nearest one therefore has
//! the whole responsibility, instead of 0 / 0.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use crate::model::error::{ModelError, require};
use crate::model::maths::gaussian_mixture::MixtureParameters;
use crate::model::maths::gaussian_mixture::{Component, MAX_COMPONENTS, components};
use crate::model::maths::regression::{Local, Prediction, Regression};

/// The largest entry of a whitening matrix, per count or rad (m). It keeps squared distances finite
/// everywhere.
const LARGEST_WHITENING: f64 = 1e12;

/// A component whose log-density is this far below the likeliest is ignored: its share of 4e-18 is
/// below the rounding error.
const NEGLIGIBLE: f64 = -40.0;

/// Gaussian mixture regression of M outputs on D inputs, and the reverse regression from the same
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
    /// The errors of [`components`], and when a component is too narrow for the arithmetic.
    pub(in crate::model) fn prepare(
        mixture: &MixtureParameters,
        si: f64,
    ) -> Result<Self, ModelError> {
        let scale: Vec<f64> = (0..D).map(|_| 1.0).chain((0..M).map(|_| si)).collect();
        Self::new(&components(mixture, &scale)?)
    }

    /// Prepares checked and scaled components over `[counts; outputs]`.
    ///
    /// # Errors
    ///
    /// When a component is too narrow for the arithmetic.
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

/// The distribution of the outputs given the inputs. Both are blocks of variables of a mixture.
#[derive(Debug, Clone, PartialEq)]
struct Conditional<const I: usize, const O: usize> {
    parts: Vec<Part<I, O>>,
}

/// The precomputed terms of one component. The module documentation defines the symbols.
#[derive(Debug, Clone, PartialEq)]
struct Part<const I: usize, const O: usize> {
    /// log w_k + log det W_k, without the constant that all components share.
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
    /// Conditions on the I variables from `input` on, and predicts the O variables from `output`
    /// on.
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

    /// The components that are not negligible, each with its responsibility times `total`.
    fn weighted<'a>(
        &'a self,
        responsibilities: &'a Responsibilities<O>,
    ) -> impl Iterator<Item = (f64, &'a Part<I, O>)> + 'a {
        let shares = responsibilities.shares.iter().zip(&self.parts);
        // NaN shares are kept, so that a NaN input gives a NaN result.
        shares
            .filter(|(share, _)| **share != 0.0)
            .map(|(share, part)| (*share, part))
    }

    fn local(&self, input: &SVector<f64, I>) -> Local<I, O> {
        let responsibilities = self.responsibilities(input);
        let origin = responsibilities.origin;
        let mut difference_sum = SVector::<f64, O>::zeros();
        let mut log_slope_sum = SVector::<f64, I>::zeros();
        let mut slope_sum = SMatrix::<f64, O, I>::zeros();
        for (share, part) in self.weighted(&responsibilities) {
            let whitened = part.whiten(input);
            let difference = part.output(&whitened) - origin;
            let log_slope = part.whitening.tr_mul(&whitened) * -share;
            difference_sum += difference * share;
            log_slope_sum += log_slope;
            slope_sum += part.slope * share + difference * log_slope.transpose();
        }
        let total = responsibilities.total;
        let difference = difference_sum / total;
        Local {
            mean: origin + difference,
            jacobian: (slope_sum - difference * log_slope_sum.transpose()) / total,
        }
    }

    fn predict(&self, input: &SVector<f64, I>) -> Prediction<O> {
        let responsibilities = self.responsibilities(input);
        let Responsibilities { total, origin, .. } = responsibilities;
        let mut difference_sum = SVector::<f64, O>::zeros();
        for (share, part) in self.weighted(&responsibilities) {
            difference_sum += (part.output(&part.whiten(input)) - origin) * share;
        }
        let mean = origin + difference_sum / total;
        let mut covariance = SMatrix::zeros();
        let mut covariance_within = SMatrix::zeros();
        for (share, part) in self.weighted(&responsibilities) {
            let share = share / total;
            let difference = part.output(&part.whiten(input)) - mean;
            covariance += (part.covariance + difference * difference.transpose()) * share;
            covariance_within += part.covariance * (share * share);
        }
        Prediction {
            mean,
            covariance,
            covariance_within,
        }
    }
}

/// The responsibilities of all components at a point.
struct Responsibilities<const O: usize> {
    /// Relative to the likeliest component, whose share is 1. Entries beyond the last component are
    /// 0.
    shares: [f64; MAX_COMPONENTS],
    /// Sum of the shares, at least 1.
    total: f64,
    /// Conditional mean of the likeliest component.
    origin: SVector<f64, O>,
}
