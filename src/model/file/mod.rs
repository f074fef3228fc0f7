//! Model files: the format, versioned JSON, and the checks of contents before any computation.
//! Unknown fields are refused.
//!
//! Files use degrees (or millimetres) and counts. The prepared model uses radians (metres) and
//! counts.

pub(in crate::model) mod store;

use serde::{Deserialize, Serialize};

use crate::model::error::{ModelError, require};
pub use crate::model::estimate::OutputUnit;
use crate::model::families::hysteresis::backlash_play::PlayParameters;
use crate::model::families::hysteresis::force_balance::BalanceParameters;
use crate::model::families::hysteresis::residual::ResidualParameters;
use crate::model::families::network::NetworkParameters;
pub use crate::model::maths::gaussian_mixture::{Mixture, MixtureParameters};
pub use crate::model::maths::hull::HullParameters;
use crate::model::maths::matrix_checks::finite;
pub use crate::model::maths::polynomial_regression::PolynomialParameters;
pub use crate::model::schema_version::{FAMILIES, FORMAT, SCHEMA_VERSION};
use crate::robot::DriveFingerprint;
use crate::units::{MAX_MOTORS, MAX_OUTPUTS};

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
        let with = |mixture| format!("{name} ({mixture})");
        self.mixture().map_or_else(|| name.to_owned(), with)
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
    /// SHA-256 of the recording's bytes, hexadecimal; of two recordings both, with a space.
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

/// The longest name of an output, in bytes.
const MAX_NAME_BYTES: usize = 16;

/// Beyond every angle and every time of a slow error.
const MAX_SLOW: f64 = 1e6;

/// Checks everything except the parameters of the family and the hull. Returns the number of
/// motors.
pub(in crate::model) fn check(file: &ModelFile) -> Result<usize, ModelError> {
    check_header(&file.format, u64::from(file.schema_version))?;
    let has_name = !file.robot_id.trim().is_empty();
    let reason = "must name the robot";
    require(has_name, || "robot_id".to_owned(), format!("`{}`", file.robot_id), reason)?;
    check_outputs(file)?;
    check_records(file)?;
    check_slow_error(file)?;
    let motors = file.hull.corners.first().map_or(0, Vec::len);
    let (key, shown) = (|| "hull.corners[0]".to_owned(), format!("{motors} numbers"));
    let reason = "must have one number per motor, 1 or 2";
    require((1..=MAX_MOTORS).contains(&motors), key, shown, reason)?;
    Ok(motors)
}

/// Checks that a file is a model of the supported schema version.
pub(in crate::model) fn check_header(format: &str, schema_version: u64) -> Result<(), ModelError> {
    if format != FORMAT {
        return Err(ModelError::Format(format.to_owned()));
    }
    if schema_version != u64::from(SCHEMA_VERSION) {
        return Err(ModelError::SchemaVersion(schema_version));
    }
    Ok(())
}

fn check_slow_error(file: &ModelFile) -> Result<(), ModelError> {
    let Some(slow) = &file.slow_error else { return Ok(()) };
    let key = |name: &str| format!("slow_error.{name}");
    let outputs = file.outputs.len();
    let shown = format!("{outputs} outputs");
    let reason = "only a model of one or two outputs has one";
    require((1..=2).contains(&outputs), || "slow_error".to_owned(), shown, reason)?;
    let [x, y] = slow.direction;
    let is_direction = (x.hypot(y) - 1.0).abs() < 1e-6 && (outputs == 2 || y == 0.0);
    let (shown, reason) =
        (format!("{:?}", slow.direction), "must have length 1, and no part beyond the outputs");
    require(is_direction, || key("direction"), shown, reason)?;
    let positive = [("deviation", slow.deviation), ("time_constant_s", slow.time_constant_s)];
    for (name, value) in positive {
        let is_valid = value > 0.0 && value < MAX_SLOW;
        require(is_valid, || key(name), value, "must be above 0 and below 1000000")?;
    }
    for (name, value) in [("rest", Some(slow.rest)), ("fast", slow.fast)] {
        let value = value.unwrap_or_default();
        let is_valid = (0.0..MAX_SLOW).contains(&value);
        require(is_valid, || key(name), value, "must be 0 to 1000000")?;
    }
    Ok(())
}

fn check_outputs(file: &ModelFile) -> Result<(), ModelError> {
    let outputs = &file.outputs;
    let count = outputs.len();
    let reason = "there must be 1 to 3";
    require((1..=MAX_OUTPUTS).contains(&count), || "outputs".to_owned(), count, reason)?;
    for (i, output) in outputs.iter().enumerate() {
        let shown = format!("`{}`", output.name);
        let key = || format!("outputs[{i}].name");
        let valid_length = (1..=MAX_NAME_BYTES).contains(&output.name.len());
        require(valid_length, key, &shown, "must be 1 to 16 bytes long")?;
        let duplicate = outputs.iter().take(i).any(|other| other.name == output.name);
        require(!duplicate, key, &shown, "is the name of another output already")?;
        let same_unit = outputs.iter().all(|other| other.unit == output.unit);
        let key = || format!("outputs[{i}].unit");
        let reason = "all outputs must have one unit, or a distance between poses has none";
        require(same_unit, key, output.unit, reason)?;
    }
    Ok(())
}

fn check_records(file: &ModelFile) -> Result<(), ModelError> {
    let TrainingRecord { log_likelihood, bic, .. } = &file.training;
    finite(log_likelihood.as_slice(), || "training.log_likelihood".to_owned())?;
    finite(bic.as_slice(), || "training.bic".to_owned())?;
    let (entries, outputs) = (file.metrics.len(), file.outputs.len());
    let reason = "must have one per output";
    require(entries == outputs, || "metrics".to_owned(), format!("{entries} entries"), reason)?;
    for (i, metrics) in file.metrics.iter().enumerate() {
        for fit in std::iter::once(&metrics.training).chain(&metrics.held_out) {
            let FitMetrics { r2, rmsd, nrmsd, mae, max } = *fit;
            finite(&[r2, rmsd, nrmsd, mae, max], || format!("metrics[{i}]"))?;
        }
    }
    Ok(())
}
