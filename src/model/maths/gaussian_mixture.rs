//! The Gaussian mixture of a model file: its checks, and scaling to rad (m) and counts.

use std::fmt;

use nalgebra::{DMatrix, DVector};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
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

/// Condition of a regression: one mixture of all motors, or one mixture per motor.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Mixture {
    /// Over `[counts; outputs]`: of a recording in which the motors move together.
    Joint(MixtureParameters),
    /// One per motor, over `[its counts; outputs]`: of a recording in which one motor moves at a
    /// time, which shows nothing of the plane between the axes. The outputs are the sum of all
    /// regressions; what they are at rest is divided among the mixtures.
    PerMotor(Vec<MixtureParameters>),
}

impl From<MixtureParameters> for Mixture {
    fn from(mixture: MixtureParameters) -> Self {
        Self::Joint(mixture)
    }
}

impl Mixture {
    /// The mixtures: one, or one per motor.
    #[must_use]
    pub fn parts(&self) -> &[MixtureParameters] {
        match self {
            Self::Joint(mixture) => std::slice::from_ref(mixture),
            Self::PerMotor(mixtures) => mixtures,
        }
    }

    /// The number of components: of several mixtures the largest.
    #[must_use]
    pub fn components(&self) -> usize {
        self.parts().iter().map(|mixture| mixture.weights.len()).max().unwrap_or_default()
    }
}

/// The number of components, as it is printed: `K = 5`.
impl fmt::Display for Mixture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = self.parts().iter().map(|mixture| mixture.weights.len());
        let mut counts: Vec<String> = counts.map(|count| count.to_string()).collect();
        counts.dedup();
        write!(f, "K = {}", counts.join(" and "))
    }
}

/// An object is one mixture, a list is one per motor.
impl<'de> Deserialize<'de> for Mixture {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Form;
        impl<'de> Visitor<'de> for Form {
            type Value = Mixture;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a mixture, or a list of one per motor")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Mixture, A::Error> {
                Deserialize::deserialize(MapAccessDeserializer::new(map)).map(Mixture::Joint)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Mixture, A::Error> {
                Deserialize::deserialize(SeqAccessDeserializer::new(list)).map(Mixture::PerMotor)
            }
        }
        deserializer.deserialize_any(Form)
    }
}

/// The most components of a mixture. It bounds the work of every tick.
pub const MAX_COMPONENTS: usize = 64;

/// Tolerance of the weight sum: a file may contain rounded numbers.
const WEIGHT_TOLERANCE: f64 = 1e-6;

/// One component, scaled.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Component {
    pub weight: f64,
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

/// Checks a mixture over as many variables as `scale` has entries, and multiplies each variable by
/// its scale. `name` is that of the mixture in the file.
pub(in crate::model) fn components(
    mixture: &MixtureParameters,
    scale: &[f64],
    name: &str,
) -> Result<Vec<Component>, ModelError> {
    check_weights(mixture, name)?;
    let (weights, means, covariances) = (&mixture.weights, &mixture.means, &mixture.covariances);
    let total: f64 = weights.iter().sum();
    let scale = DVector::from_column_slice(scale);
    let each = weights.iter().zip(means).zip(covariances).enumerate().map(
        |(k, ((weight, mean), covariance))| {
            let mean = checked_mean(mean, scale.len(), || format!("{name}.means[{k}]"))?;
            let key = || format!("{name}.covariances[{k}]");
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

fn check_weights(mixture: &MixtureParameters, name: &str) -> Result<(), ModelError> {
    let key = || format!("{name}.weights");
    let count = mixture.weights.len();
    let shown = format!("{count} components");
    require((1..=MAX_COMPONENTS).contains(&count), key, &shown, "there must be 1 to 64")?;
    for (list, entries) in
        [("means", mixture.means.len()), ("covariances", mixture.covariances.len())]
    {
        let reason = "must have one entry per weight";
        require(entries == count, || format!("{name}.{list}"), entries, reason)?;
    }
    for (k, weight) in mixture.weights.iter().enumerate() {
        let positive = weight.is_finite() && *weight > 0.0;
        let reason = "must be a finite number above 0";
        require(positive, || format!("{name}.weights[{k}]"), weight, reason)?;
    }
    let total: f64 = mixture.weights.iter().sum();
    let reason = "the weights must sum to 1";
    require((total - 1.0).abs() <= WEIGHT_TOLERANCE, key, format!("sum {total}"), reason)
}

fn checked_mean(
    mean: &[f64],
    variables: usize,
    key: impl Fn() -> String + Copy,
) -> Result<DVector<f64>, ModelError> {
    let reason = "must have one number per motor and output";
    require(mean.len() == variables, key, format!("{} numbers", mean.len()), reason)?;
    parameters(mean, key)?;
    Ok(DVector::from_column_slice(mean))
}
