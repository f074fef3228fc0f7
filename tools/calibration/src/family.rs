//! The families of models that can be fitted, and their model files.

use std::fmt;
use std::str::FromStr;

use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, HullParameters, ModelFile, OutputMetrics, SCHEMA_VERSION,
    TrainingRecord,
};
use i2ris::model::{Model, ModelError};

use crate::linear::LinearFit;
use crate::metrics::{metrics, predictions};
use crate::recording::Recording;
use crate::split::Split;

/// A family of models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Family {
    /// Affine least squares: the baseline.
    Linear,
    /// The analytic chain from counts to bend: the baseline with geometry.
    Kinematic,
    /// Gaussian mixture regression on the counts, without memory.
    Gmr,
    /// Gaussian mixture regression on the counts and the direction of travel: the published way.
    GmrDirection,
    /// Play operators, then Gaussian mixture regression and a residual.
    GmrPlay,
    /// Stop operators with friction that grows with the pull of the wires, then the same.
    GmrStop,
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Linear => "linear",
            Self::Kinematic => "kinematic",
            Self::Gmr => "gmr",
            Self::GmrDirection => "gmr-direction",
            Self::GmrPlay => "gmr-play",
            Self::GmrStop => "gmr-stop",
        })
    }
}

impl Family {
    /// All of them, the simplest first.
    pub const ALL: [Self; 6] = [
        Self::Linear,
        Self::Kinematic,
        Self::Gmr,
        Self::GmrDirection,
        Self::GmrPlay,
        Self::GmrStop,
    ];

    /// Whether models of the family remember the past.
    #[must_use]
    pub fn remembers(self) -> bool {
        match self {
            Self::Linear | Self::Kinematic | Self::Gmr => false,
            Self::GmrDirection | Self::GmrPlay | Self::GmrStop => true,
        }
    }
}

/// Text that names no family.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{found}` is no family of models: there are {}", names())]
pub struct ParseFamilyError {
    found: String,
}

fn names() -> String {
    Family::ALL.map(|family| format!("`{family}`")).join(", ")
}

impl FromStr for Family {
    type Err = ParseFamilyError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let named = Self::ALL
            .into_iter()
            .find(|family| family.to_string() == text);
        named.ok_or_else(|| ParseFamilyError {
            found: text.to_owned(),
        })
    }
}

/// A family with its parameters, fitted.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fitted {
    pub family: FamilyParameters,
    /// Of the mixture, nats per row; `None` for families without one.
    pub log_likelihood: Option<f64>,
    /// Of the mixture.
    pub bic: Option<f64>,
    /// Random starts per mixture.
    pub restarts: usize,
}

impl Fitted {
    /// Of a family without a mixture.
    pub fn plain(family: FamilyParameters) -> Self {
        Self {
            family,
            log_likelihood: None,
            bic: None,
            restarts: 0,
        }
    }
}

impl From<&LinearFit> for Fitted {
    fn from(fit: &LinearFit) -> Self {
        let LinearFit {
            gain,
            offset,
            covariance,
        } = fit.clone();
        Self::plain(FamilyParameters::Linear {
            gain,
            offset,
            covariance,
        })
    }
}

/// No metrics.
const NONE: FitMetrics = FitMetrics {
    r2: 0.0,
    rmsd: 0.0,
    nrmsd: 0.0,
    mae: 0.0,
    max: 0.0,
};

/// What a model file says beside the parameters of the family.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame<'a> {
    pub recording: &'a Recording,
    pub split: &'a Split,
    /// Indices of the rows used for training.
    pub training: &'a [usize],
    pub hull: &'a HullParameters,
    pub robot_id: &'a str,
    pub seed: u64,
}

impl Frame<'_> {
    /// A checked model with its metrics.
    ///
    /// # Errors
    ///
    /// When the model is refused, as it would be by the controller.
    pub fn model(&self, fitted: &Fitted) -> Result<Model, ModelError> {
        let mut file = self.file(fitted);
        file.metrics = self.measure(&Model::from_file(file.clone())?);
        Model::from_file(file)
    }

    /// The model file, with metrics that only hold the place of those that take the model to
    /// compute.
    fn file(&self, fitted: &Fitted) -> ModelFile {
        ModelFile {
            format: FORMAT.to_owned(),
            schema_version: SCHEMA_VERSION,
            robot_id: self.robot_id.to_owned(),
            outputs: self.recording.outputs().to_vec(),
            family: fitted.family.clone(),
            hull: self.hull.clone(),
            training: TrainingRecord {
                data_file: self.recording.name().to_owned(),
                data_sha256: self.recording.sha256().to_owned(),
                rows: self.training.len(),
                seed: self.seed,
                restarts: fitted.restarts,
                log_likelihood: fitted.log_likelihood,
                bic: fitted.bic,
                software: concat!("i2ris-calibration ", env!("CARGO_PKG_VERSION")).to_owned(),
            },
            metrics: vec![
                OutputMetrics {
                    training: NONE,
                    held_out: None
                };
                self.recording.outputs().len()
            ],
        }
    }

    /// Metrics on the rows used for training and on all rows held out, flagged ones included: what
    /// is tested is not chosen by how well it fits.
    fn measure(&self, model: &Model) -> Vec<OutputMetrics> {
        let predicted = predictions(model, self.recording);
        let rows = self.recording.rows();
        let pair = |row: usize, output: usize| (rows[row].outputs[output], predicted[row][output]);
        let of_output = |output| OutputMetrics {
            // Training rows of a constant output were refused before anything was fitted.
            training: metrics(self.training.iter().map(|row| pair(*row, output))).unwrap_or(NONE),
            held_out: metrics(self.split.held_out().map(|row| pair(row, output))),
        };
        (0..self.recording.outputs().len()).map(of_output).collect()
    }
}
