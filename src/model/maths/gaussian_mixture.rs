//! The Gaussian mixture of a model file: its checks, and scaling to rad (m) and counts.

use nalgebra::{DMatrix, DVector};

use serde::{Deserialize, Serialize};

use crate::model::error::{ModelError, require};
use crate::model::maths::matrix_checks::{parameters, positive_definite, square};

/// A Gaussian mixture over `n` variables with `K` components.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MixtureParameters {
    /// K weights with sum 1.
    pub weights: Vec<f64>,
    /// K rows of n.
    pub means: Vec<Vec<f64>>,
    /// K times n rows of n.
    pub covariances: Vec<Vec<Vec<f64>>>,
}

/// The most components of a mixture. It bounds the work of every tick.
pub const MAX_COMPONENTS: usize = 64;

/// Tolerance of the sum of the weights: a file may contain rounded numbers.
const WEIGHT_TOLERANCE: f64 = 1e-6;

/// One component, scaled.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Component {
    pub weight: f64,
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

/// Checks a mixture over as many variables as `scale` has entries, and multiplies each variable by
/// its scale.
///
/// # Errors
///
/// When sizes differ, a number is not finite, weights are not positive or do not sum to 1, or a
/// covariance is not symmetric positive definite.
pub(in crate::model) fn components(
    mixture: &MixtureParameters,
    scale: &[f64],
) -> Result<Vec<Component>, ModelError> {
    check_weights(mixture)?;
    let (weights, means, covariances) = (&mixture.weights, &mixture.means, &mixture.covariances);
    let total: f64 = weights.iter().sum();
    let scale = DVector::from_column_slice(scale);
    let each = weights.iter().zip(means).zip(covariances).enumerate().map(
        |(k, ((weight, mean), covariance))| {
            let mean = checked_mean(k, mean, scale.len())?;
            let key = || format!("family.mixture.covariances[{k}]");
            let covariance = square(covariance, scale.len(), key)?;
            positive_definite(&covariance, key)?;
            Ok(Component {
                weight: weight / total,
                mean: mean.component_mul(&scale),
                covariance: covariance.component_mul(&(&scale * scale.transpose())),
            })
        },
    );
    each.collect()
}

fn check_weights(mixture: &MixtureParameters) -> Result<(), ModelError> {
    let key = || "family.mixture.weights".to_owned();
    let count = mixture.weights.len();
    let shown = format!("{count} components");
    require((1..=MAX_COMPONENTS).contains(&count), key, &shown, "there must be 1 to 64")?;
    for (name, entries) in
        [("means", mixture.means.len()), ("covariances", mixture.covariances.len())]
    {
        require(
            entries == count,
            || format!("family.mixture.{name}"),
            entries,
            "must have one entry per weight",
        )?;
    }
    for (k, weight) in mixture.weights.iter().enumerate() {
        let positive = weight.is_finite() && *weight > 0.0;
        require(
            positive,
            || format!("family.mixture.weights[{k}]"),
            weight,
            "must be a finite number above 0",
        )?;
    }
    let total: f64 = mixture.weights.iter().sum();
    require(
        (total - 1.0).abs() <= WEIGHT_TOLERANCE,
        key,
        format!("sum {total}"),
        "the weights must sum to 1",
    )
}

fn checked_mean(k: usize, mean: &[f64], variables: usize) -> Result<DVector<f64>, ModelError> {
    let key = || format!("family.mixture.means[{k}]");
    let reason = "must have one number per motor and output";
    require(mean.len() == variables, key, format!("{} numbers", mean.len()), reason)?;
    parameters(mean, key)?;
    Ok(DVector::from_column_slice(mean))
}
