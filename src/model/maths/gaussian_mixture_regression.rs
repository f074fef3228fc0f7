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
//!
//! Every component is whitened once per evaluation.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use crate::model::error::{ModelError, require};
use crate::model::maths::gaussian_mixture::{
    Component, MAX_COMPONENTS, MixtureParameters, components,
};
use crate::model::maths::{Local, Prediction, Regression, exp_above};

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
    /// Checks a mixture over `[counts; outputs]` and scales its outputs by `si`. `name` is that of
    /// the mixture in the file.
    pub(in crate::model) fn prepare(
        mixture: &MixtureParameters,
        si: f64,
        name: &str,
    ) -> Result<Self, ModelError> {
        let scale: Vec<f64> = (0..D).map(|_| 1.0).chain((0..M).map(|_| si)).collect();
        let components = components(mixture, &scale, name)?;
        Ok(Self {
            forward: Conditional::new(&components, 0, D, name)?,
            backward: Conditional::new(&components, D, 0, name)?,
        })
    }
}

impl<const D: usize, const M: usize> Regression<D, M> for Gmr<D, M> {
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M> {
        self.forward.local(input)
    }

    fn mean(&self, input: &SVector<f64, D>) -> SVector<f64, M> {
        self.forward.mean(input)
    }

    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M> {
        self.forward.predict(input)
    }

    /// The conditional mean of the inputs, given the outputs.
    fn second_start(&self, goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        Some(self.backward.mean(goal))
    }
}

/// Distribution of the outputs given the inputs. Both are variable blocks of a mixture.
#[derive(Debug, Clone, PartialEq)]
struct Conditional<const I: usize, const O: usize> {
    parts: Vec<Part<I, O>>,
}

/// The components at a point.
struct Weighted<const I: usize, const O: usize> {
    /// Responsibility of every component relative to the likeliest one, whose share is 1.
    shares: [f64; MAX_COMPONENTS],
    /// z_k.
    whitened: [SVector<f64, I>; MAX_COMPONENTS],
    /// The conditional mean of the likeliest component: the origin.
    origin: SVector<f64, O>,
}

impl<const I: usize, const O: usize> Conditional<I, O> {
    fn new(
        components: &[Component],
        input: usize,
        output: usize,
        name: &str,
    ) -> Result<Self, ModelError> {
        let part = |(k, component)| Part::new(k, component, input, output, name);
        let parts = components.iter().enumerate().map(part).collect::<Result<_, _>>()?;
        Ok(Self { parts })
    }

    /// Whitens all components, and finds the likeliest one. A NaN input gives shares of NaN.
    fn weigh(&self, input: &SVector<f64, I>) -> Weighted<I, O> {
        let mut weighted = Weighted {
            shares: [0.0; MAX_COMPONENTS],
            whitened: [SVector::zeros(); MAX_COMPONENTS],
            origin: SVector::zeros(),
        };
        let mut highest = f64::NEG_INFINITY;
        let entries = weighted.shares.iter_mut().zip(&mut weighted.whitened);
        for ((log, whitened), part) in entries.zip(&self.parts) {
            *whitened = part.whitening * (input - part.input_mean);
            *log = part.log_height - 0.5 * whitened.norm_squared();
            if *log > highest {
                highest = *log;
                weighted.origin = part.output_mean + part.gain * *whitened;
            }
        }
        for (share, _) in weighted.shares.iter_mut().zip(&self.parts) {
            *share = exp_above(*share - highest, NEGLIGIBLE);
        }
        weighted
    }

    /// Share, whitened distance and prepared terms of every component.
    fn terms<'a>(
        &'a self,
        weighted: &'a Weighted<I, O>,
    ) -> impl Iterator<Item = (f64, &'a SVector<f64, I>, &'a Part<I, O>)> {
        let entries = weighted.shares.iter().zip(&weighted.whitened).zip(&self.parts);
        entries.map(|((share, whitened), part)| (*share, whitened, part))
    }

    fn local(&self, input: &SVector<f64, I>) -> Local<I, O> {
        let weighted = self.weigh(input);
        let (mut total, mut difference) = (0.0, SVector::<f64, O>::zeros());
        let mut log_slope = SVector::<f64, I>::zeros();
        let mut slope = SMatrix::<f64, O, I>::zeros();
        for (share, whitened, part) in self.terms(&weighted) {
            let from_origin = share * (part.output_mean + part.gain * whitened - weighted.origin);
            let back = part.whitening.tr_mul(whitened);
            total += share;
            difference += from_origin;
            log_slope -= back * share;
            slope += part.slope * share - from_origin * back.transpose();
        }
        let difference = difference / total;
        Local {
            mean: weighted.origin + difference,
            jacobian: (slope - difference * log_slope.transpose()) / total,
        }
    }

    fn mean(&self, input: &SVector<f64, I>) -> SVector<f64, O> {
        self.mean_of(&self.weigh(input)).0
    }

    /// The mean, and the sum of the shares: at least 1.
    fn mean_of(&self, weighted: &Weighted<I, O>) -> (SVector<f64, O>, f64) {
        let (mut total, mut difference) = (0.0, SVector::<f64, O>::zeros());
        for (share, whitened, part) in self.terms(weighted) {
            total += share;
            difference += share * (part.output_mean + part.gain * whitened - weighted.origin);
        }
        (weighted.origin + difference / total, total)
    }

    fn predict(&self, input: &SVector<f64, I>) -> Prediction<O> {
        let weighted = self.weigh(input);
        let (mean, total) = self.mean_of(&weighted);
        let mut covariance = SMatrix::<f64, O, O>::zeros();
        for (share, whitened, part) in self.terms(&weighted) {
            let difference = part.output_mean + part.gain * whitened - mean;
            covariance += (part.covariance + difference * difference.transpose()) * (share / total);
        }
        Prediction { mean, covariance }
    }
}

/// The largest entry of a whitening matrix, per count or rad (m). It keeps squared distances finite
/// everywhere.
const MAX_WHITENING: f64 = 1e12;

/// The precomputed terms of one component, with the symbols above.
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
            reason: "the component is too narrow to compute with: fit with fewer components",
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
        let key = || format!("{name}.weights[{k}]");
        require(log_height.is_finite(), key, component.weight, "is too small")?;
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
