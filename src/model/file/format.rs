//! The format of model files: versioned JSON. Unknown fields are refused.
//!
//! Files use degrees (or millimetres) and counts. The prepared model uses radians (metres) and
//! counts.

use serde::{Deserialize, Serialize};

use crate::model::families::hysteresis::backlash_play::PlayParameters;
use crate::model::families::hysteresis::force_balance::BalanceParameters;
use crate::model::families::hysteresis::residual::ResidualParameters;
use crate::model::families::network::NetworkParameters;
use crate::robot::DriveFingerprint;

pub use crate::model::estimate::OutputUnit;
pub use crate::model::maths::gaussian_mixture::{Mixture, MixtureParameters};
pub use crate::model::maths::hull::HullParameters;
pub use crate::model::maths::polynomial_regression::PolynomialParameters;
pub use crate::model::schema_version::{FAMILIES, FORMAT, SCHEMA_VERSION};

/// A model file that is not checked yet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelFile {
    /// [`FORMAT`].
    pub format: String,
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The robot of the calibration. The controller compares it with its configuration.
    pub robot_id: String,
    /// The outputs of the model, one to three.
    pub outputs: Vec<OutputSpec>,
    /// The parameters of the family.
    pub family: FamilyParameters,
    /// The region of motor space that calibration visited.
    pub hull: HullParameters,
    /// The origin of the model.
    pub training: TrainingRecord,
    /// Quality of the fit, one entry per output.
    pub metrics: Vec<OutputMetrics>,
    /// The slow part of the error, where there is one: the adaptation follows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slow_error: Option<SlowErrorParameters>,
    /// Why the fit found the model worthless, if it was written by `--force` all the same. The
    /// controller refuses it unless its configuration allows such models.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worthless: Option<String>,
}

/// Slow component of the model error: one number along one direction of one or two outputs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlowErrorParameters {
    /// Unit vector.
    pub direction: [f64; 2],
    /// Its standard deviation, in the unit of the outputs, above 0.
    pub deviation: f64,
    /// Time after which its autocorrelation has fallen to 1/e, s, above 0.
    pub time_constant_s: f64,
    /// Standard deviation of the error across the direction, in the unit of the outputs.
    pub rest: f64,
    /// Standard deviation of what changes from row to row along the direction, in the unit of the
    /// outputs. Where it is absent, it is taken to be `rest`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fast: Option<f64>,
}

/// One output of a model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputSpec {
    /// `pitch`, `yaw`, `x`, ...
    pub name: String,
    /// Unit in the file.
    pub unit: OutputUnit,
}

/// The parameters of a family, in units of the file. `d` motors, `m` outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum FamilyParameters {
    /// `output = gain * counts + offset`.
    Linear {
        /// m rows of d.
        gain: Vec<Vec<f64>>,
        /// m.
        offset: Vec<f64>,
        /// Covariance of the residuals, m rows of m.
        covariance: Vec<Vec<f64>>,
    },
    /// Gaussian mixture regression on the counts, without memory.
    Gmr {
        /// Over `[counts; outputs]`, or one per motor.
        mixture: Mixture,
    },
    /// Play operators, then Gaussian mixture regression on the virtual counts, then a residual.
    GmrPlay {
        /// Operators from counts to virtual counts.
        plays: PlayParameters,
        /// Over `[virtual counts; outputs]`, or one per motor.
        mixture: Mixture,
        /// The remaining error; absent without a residual.
        residual: Option<ResidualParameters>,
        /// The region of virtual counts that calibration visited.
        virtual_hull: HullParameters,
    },
    /// A force balance of gear, wires, spring and friction, then a polynomial of the virtual
    /// counts.
    ForceBalance {
        /// Operator from counts to virtual counts.
        balance: BalanceParameters,
        /// Polynomial from virtual counts to outputs.
        read_out: PolynomialParameters,
        /// The region of virtual counts that calibration visited. Beyond it the read-out is affine.
        virtual_hull: HullParameters,
    },
    /// A network that was trained elsewhere.
    Network {
        /// Network from counts to outputs.
        network: NetworkParameters,
        /// The range of every motor after which earlier motion is forgotten, counts; d.
        memory_counts: Vec<f64>,
        /// Straight line through the recording, used beyond a step of the network: m rows of d.
        gain: Vec<Vec<f64>>,
        /// Covariance of the errors on the rows held out, m rows of m.
        covariance: Vec<Vec<f64>>,
    },
}

impl FamilyParameters {
    /// The name of the family, with the components of a mixture: `gmr (K = 5)`.
    #[must_use]
    pub fn title(&self) -> String {
        let name = match self {
            Self::Linear { .. } => "linear",
            Self::Gmr { .. } => "gmr",
            Self::GmrPlay { .. } => "gmr-play",
            Self::ForceBalance { .. } => "force-balance",
            Self::Network { .. } => "network",
        };
        match self.mixture() {
            Some(mixture) => format!("{name} ({mixture})"),
            None => name.to_owned(),
        }
    }

    /// The mixture of a family that has one.
    #[must_use]
    pub fn mixture(&self) -> Option<&Mixture> {
        match self {
            Self::Gmr { mixture } | Self::GmrPlay { mixture, .. } => Some(mixture),
            _ => None,
        }
    }
}

/// The origin of a model.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingRecord {
    /// Name of the recording, without folders.
    pub data_file: String,
    /// SHA-256 of the recording's bytes, hexadecimal.
    pub data_sha256: String,
    /// Rows used for training.
    pub rows: usize,
    /// Seed of the random starts.
    pub seed: u64,
    /// Starts tried.
    pub restarts: usize,
    /// Mean log-likelihood per row, nats; absent for families without one.
    pub log_likelihood: Option<f64>,
    /// Bayesian information criterion; absent for families without one.
    pub bic: Option<f64>,
    /// Version of the software that fitted it.
    pub software: String,
    /// Date and time of the recording, UTC; absent where nothing says it. The same recording gives
    /// the same model on any day, so the day of the fit is not in the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded_at: Option<String>,
    /// Gain of the affine model of the same rows, m rows of d; absent in older files, and for loops
    /// without a slope.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linear_gain: Option<Vec<Vec<f64>>>,
    /// Drive settings at the recording; absent if unknown. The controller compares them with those
    /// of its drives.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<DriveFingerprint>,
}

/// Fit quality of one output, in its unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputMetrics {
    /// On the rows used for training.
    pub training: FitMetrics,
    /// On the held-out rows; absent without held-out rows.
    pub held_out: Option<FitMetrics>,
}

/// Metrics of one output on one set of rows.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitMetrics {
    /// Coefficient of determination.
    pub r2: f64,
    /// Root mean square deviation.
    pub rmsd: f64,
    /// `rmsd` divided by the range of the measured values.
    pub nrmsd: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Largest absolute error.
    pub max: f64,
}
