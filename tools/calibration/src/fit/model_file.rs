//! Model files with their metrics.

use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, HullParameters, ModelFile, OutputMetrics, SCHEMA_VERSION,
    TrainingRecord,
};
use i2ris::model::{Hull, Model, ModelError};
use i2ris::robot::DriveFingerprint;
use i2ris::units::MAX_OUTPUTS;
use i2ris_report::statistics::min_max;

use super::metrics::{known_from, metrics, predictions};
use super::slow_error::slow_error;
use super::split::Split;
use crate::quality::{Finding, Quality};
use crate::recording::Recording;
use crate::regression::linear::LinearFit;

/// A family with its parameters, fitted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fitted {
    pub family: FamilyParameters,
    /// Log-likelihood of the mixture, nats per row; `None` for families without one.
    pub log_likelihood: Option<f64>,
    pub bic: Option<f64>,
    pub restarts: usize,
}

impl Fitted {
    /// A family without a mixture.
    pub fn plain(family: FamilyParameters) -> Self {
        Self { family, log_likelihood: None, bic: None, restarts: 0 }
    }
}

impl From<&LinearFit> for Fitted {
    fn from(fit: &LinearFit) -> Self {
        let LinearFit { gain, offset, covariance } = fit.clone();
        Self::plain(FamilyParameters::Linear { gain, offset, covariance })
    }
}

/// Deviations for motion that a recording does not contain: for the plane between the axes as a
/// part of the half range (covers nine of ten errors on three of four emulated snakes), and for
/// small loops as a part of the error of a straight line (RMS of 44 snakes of 11 physics).
const UNSEEN_PLANE: f64 = 0.01;
const UNSEEN_LOOPS: f64 = 0.06;

/// If a model explains more than this part of the variance of every output, ...
const MIN_LOOP_R2: f64 = 0.5;
/// ... and a straight line less than this part, the motion is a loop without a slope, and the gain
/// of the line is noise.
const MAX_LEVEL_R2: f64 = 0.02;

const NO_METRICS: OutputMetrics = OutputMetrics {
    training: FitMetrics { r2: 0.0, rmsd: 0.0, nrmsd: 0.0, mae: 0.0, max: 0.0 },
    held_out: None,
};

/// The content of a model file except the parameters of the family.
#[derive(Debug, Clone, Copy)]
pub(super) struct FileContext<'a> {
    pub recording: &'a Recording,
    pub split: &'a Split,
    /// Contains the spikes; `None`: they count.
    pub spikes: Option<&'a Quality>,
    pub limits: &'a [Finding],
    pub training: &'a [usize],
    pub hull: &'a HullParameters,
    /// The affine model of the same rows.
    pub straight: &'a LinearFit,
    pub robot_id: &'a str,
    pub recorded_at: Option<&'a str>,
    pub drives: &'a [DriveFingerprint],
    pub seed: u64,
}

impl FileContext<'_> {
    /// A checked model with its metrics. Fails if the controller would refuse it.
    pub fn model(&self, fitted: &Fitted) -> Result<Model, ModelError> {
        let mut file = self.file(fitted);
        let line = file.training.linear_gain.take();
        let unlined = Model::from_file(file.clone());
        file.training.linear_gain = line;
        let model = unlined.or_else(|_| Model::from_file(file.clone()))?;
        let predicted = predictions(&model, self.recording);
        file.metrics = self.measure(&predicted);
        if self.is_level(&file.metrics) {
            file.training.linear_gain = None;
        }
        if let Some(covariance) = constant_covariance(&mut file.family) {
            *covariance = self.covariance(&predicted);
        }
        file.slow_error = slow_error(&model, self.recording, &self.held_out_or_training());
        Model::from_file(file)
    }

    /// The model file without metrics, which need the model.
    fn file(&self, fitted: &Fitted) -> ModelFile {
        ModelFile {
            slow_error: None,
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
                recorded_at: self.recorded_at.map(str::to_owned),
                drives: self.drives.to_vec(),
                linear_gain: Some(self.straight.gain.clone()),
            },
            worthless: None,
            metrics: vec![NO_METRICS; self.recording.outputs().len()],
        }
    }

    /// Whether the model explains a loop without a slope, as of friction.
    fn is_level(&self, found: &[OutputMetrics]) -> bool {
        found.iter().enumerate().all(|(output, found)| {
            let FitMetrics { r2, rmsd, .. } = found.training;
            let variance = rmsd.powi(2) / (1.0 - r2);
            let unexplained = self.straight.covariance[output][output];
            r2 > MIN_LOOP_R2 && unexplained > (1.0 - MAX_LEVEL_R2) * variance
        })
    }

    /// Held-out rows if there are any; their error is that of motion in use. A model is not used
    /// outside the hull of its training rows, so rows outside count only if they are the majority.
    pub fn held_out_or_training(&self) -> Vec<usize> {
        let held_out = self.judging();
        if held_out.is_empty() { self.training.to_vec() } else { held_out }
    }

    fn judging(&self) -> Vec<usize> {
        let hull = Hull::new(self.hull, self.recording.motors());
        let counts = |row: usize| &self.recording.rows()[row].counts;
        let is_inside = |row: &usize| hull.as_ref().is_ok_and(|hull| hull.contains(counts(*row)));
        let inside: Vec<usize> = self.split.held_out().filter(is_inside).collect();
        let all: Vec<usize> = self.split.held_out().collect();
        if 2 * inside.len() < all.len() { all } else { inside }
    }

    /// Mean products of the errors, for the deviation of an estimate. Camera spikes do not count,
    /// because they are rejected in use.
    fn covariance(&self, predicted: &[[f64; MAX_OUTPUTS]]) -> Vec<Vec<f64>> {
        let mut rows = self.held_out_or_training();
        let flagged = |row: &usize| self.spikes.is_some_and(|quality| quality.is_flagged(*row));
        rows.retain(|row| !flagged(row));
        // Before, the position of the snake in its loops is unknown.
        let known = rows.partition_point(|row| *row < known_from(self.recording));
        if 2 * known <= rows.len() {
            rows.drain(..known);
        }
        let outputs = self.recording.outputs().len();
        let mut covariance = vec![vec![0.0; outputs]; outputs];
        for row in &rows {
            let measured = &self.recording.rows()[*row].outputs;
            let error = |output: usize| measured[output] - predicted[*row][output];
            for (i, line) in covariance.iter_mut().enumerate() {
                for (j, entry) in line.iter_mut().enumerate() {
                    *entry += error(i) * error(j) / rows.len() as f64;
                }
            }
        }
        for (output, line) in covariance.iter_mut().enumerate() {
            line[output] += self.unseen(output);
        }
        covariance
    }

    /// Variance of an output in motion that the recording does not contain.
    fn unseen(&self, output: usize) -> f64 {
        let mut variance = 0.0;
        if self.limits.iter().any(Finding::hides_plane) {
            let values = self.training.iter().map(|row| self.recording.rows()[*row].outputs);
            let (low, high) = min_max(values.map(|values| values[output]));
            variance += (UNSEEN_PLANE * 0.5 * (high - low)).powi(2);
        }
        if self.limits.iter().any(Finding::hides_small_loops) {
            variance += UNSEEN_LOOPS.powi(2) * self.straight.covariance[output][output];
        }
        variance
    }

    /// Metrics on the training rows and on the held-out rows, including flagged ones: the test rows
    /// are not selected by how well they fit.
    fn measure(&self, predicted: &[[f64; MAX_OUTPUTS]]) -> Vec<OutputMetrics> {
        let rows = self.recording.rows();
        let measure = |rows_used: &mut dyn Iterator<Item = usize>, output: usize| {
            let pair = |row: usize| (rows[row].outputs[output], predicted[row][output]);
            metrics(&rows_used.map(pair).collect::<Vec<_>>())
        };
        let of_output = |output| OutputMetrics {
            // Training rows of a constant output were refused before anything was fitted.
            training: measure(&mut self.training.iter().copied(), output)
                .unwrap_or(NO_METRICS.training),
            held_out: measure(&mut self.judging().into_iter(), output),
        };
        (0..self.recording.outputs().len()).map(of_output).collect()
    }
}

/// The covariance of the errors, for a family with one for all positions.
pub(super) fn constant_covariance(family: &mut FamilyParameters) -> Option<&mut Vec<Vec<f64>>> {
    match family {
        FamilyParameters::ForceBalance { read_out, .. } => Some(&mut read_out.covariance),
        FamilyParameters::Network { covariance, .. } => Some(covariance),
        _ => None,
    }
}
