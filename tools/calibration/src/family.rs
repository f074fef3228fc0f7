//! The families of models that can be fitted, and their model files.

use std::fmt;
use std::str::FromStr;

use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, HullParameters, ModelFile, OutputMetrics, SCHEMA_VERSION, TrainingRecord,
};
use i2ris::model::{Model, ModelError};

use crate::em::MixtureFit;
use crate::linear::LinearFit;
use crate::metrics::{metrics, predictions};
use crate::recording::Recording;
use crate::split::Split;

/// A family of models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Family {
    /// Affine least squares: the baseline.
    Linear,
    /// Gaussian mixture regression on the counts, without memory.
    Gmr,
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Linear => "linear",
            Self::Gmr => "gmr",
        })
    }
}

/// Text that names no family.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no family of models: there are `linear` and `gmr`")]
pub struct ParseFamilyError(String);

impl FromStr for Family {
    type Err = ParseFamilyError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        [Self::Linear, Self::Gmr]
            .into_iter()
            .find(|family| family.to_string() == text)
            .ok_or_else(|| ParseFamilyError(text.to_owned()))
    }
}

/// Parameters that were fitted.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Fitted<'a> {
    Linear(&'a LinearFit),
    Gmr(&'a MixtureFit),
}

impl Fitted<'_> {
    fn parameters(&self) -> FamilyParameters {
        match self {
            Self::Linear(fit) => FamilyParameters::Linear {
                gain: fit.gain.clone(),
                offset: fit.offset.clone(),
                covariance: fit.covariance.clone(),
            },
            Self::Gmr(fit) => FamilyParameters::Gmr { mixture: fit.parameters.clone() },
        }
    }
}

/// No metrics.
const NONE: FitMetrics = FitMetrics { r2: 0.0, rmsd: 0.0, nrmsd: 0.0, mae: 0.0, max: 0.0 };

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
    pub restarts: usize,
}

impl Frame<'_> {
    /// A checked model with its metrics.
    ///
    /// # Errors
    ///
    /// When the model is refused, as it would be by the controller.
    pub fn model(&self, fitted: Fitted) -> Result<Model, ModelError> {
        let mut file = self.file(fitted);
        file.metrics = self.measure(&Model::from_file(file.clone())?);
        Model::from_file(file)
    }

    /// The model file, with metrics that only hold the place of those that take the model to compute.
    fn file(&self, fitted: Fitted) -> ModelFile {
        let fit = match fitted {
            Fitted::Linear(_) => None,
            Fitted::Gmr(fit) => Some(fit),
        };
        ModelFile {
            format: FORMAT.to_owned(),
            schema_version: SCHEMA_VERSION,
            robot_id: self.robot_id.to_owned(),
            outputs: self.recording.outputs().to_vec(),
            family: fitted.parameters(),
            hull: self.hull.clone(),
            training: TrainingRecord {
                data_file: self.recording.name().to_owned(),
                data_sha256: self.recording.sha256().to_owned(),
                rows: self.training.len(),
                seed: self.seed,
                restarts: fit.map_or(0, |_| self.restarts),
                log_likelihood: fit.map(|fit| fit.log_likelihood),
                bic: fit.map(|fit| fit.bic),
                software: concat!("i2ris-calibration ", env!("CARGO_PKG_VERSION")).to_owned(),
            },
            metrics: vec![OutputMetrics { training: NONE, held_out: None }; self.recording.outputs().len()],
        }
    }

    /// Metrics on the rows used for training and on all rows held out, flagged ones included: what is tested is not
    /// chosen by how well it fits.
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
