//! Model files with their metrics, and the slow component of the error: the residual lies along one
//! direction of the outputs, and changes slowly, so that a camera can follow it.

use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, HullParameters, ModelFile, OutputMetrics, SCHEMA_VERSION,
    SlowErrorParameters, TrainingRecord,
};
use i2ris::model::{Hull, Model, ModelError};
use i2ris::robot::DriveFingerprint;
use i2ris::units::MAX_OUTPUTS;
use i2ris_report::statistics::{median, min_max};
use nalgebra::Matrix2;

use super::metrics::{known_from, metrics, predictions};
use super::split::Split;
use crate::quality::{Finding, Quality};
use crate::recording::Recording;
use crate::regression::linear::LinearFit;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fitted {
    pub family: FamilyParameters,
    /// Log-likelihood of the mixture, nats per row; `None` for families without one.
    pub log_likelihood: Option<f64>,
    pub bic: Option<f64>,
    pub restarts: usize,
}

impl Fitted {
    pub fn plain(family: FamilyParameters) -> Self {
        Self { family, log_likelihood: None, bic: None, restarts: 0 }
    }
}

/// Deviations for motion that a recording does not contain: for the plane between the axes as a
/// part of the half range (covers nine of ten errors on three of four emulated snakes), and for
/// small loops as a part of the error of a straight line (RMS of 44 snakes of 11 physics).
const UNSEEN_PLANE: f64 = 0.01;
const UNSEEN_LOOPS: f64 = 0.06;

/// If a model explains more than this part of the variance of every output, ...
const MIN_LOOP_R2: f64 = 0.5;
/// ... and a straight line less than this part, the loop has no slope: the gain is noise.
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

    /// Held-out rows if there are any; their error is that of motion in use.
    pub fn held_out_or_training(&self) -> Vec<usize> {
        let held_out = self.counted();
        if held_out.is_empty() { self.training.to_vec() } else { held_out }
    }

    /// Held-out rows that count: those outside the hull of the training rows only as the majority.
    pub fn counted(&self) -> Vec<usize> {
        let hull = Hull::new(self.hull, self.recording.motors());
        let counts = |row: usize| &self.recording.rows()[row].counts;
        let is_inside = |row: &usize| hull.as_ref().is_ok_and(|hull| hull.contains(counts(*row)));
        let inside: Vec<usize> = self.split.held_out().filter(is_inside).collect();
        let all: Vec<usize> = self.split.held_out().collect();
        if 2 * inside.len() < all.len() { all } else { inside }
    }

    /// Mean products of the errors, without camera spikes, which are rejected in use.
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

    /// Metrics on training and held-out rows, also flagged ones: they are not selected by the fit.
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
            held_out: measure(&mut self.counted().into_iter(), output),
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

/// Minimum share of the error along the direction. With less it is not one number.
const MIN_SHARE: f64 = 0.85;

/// Minimum time for which a slow error stays the same, s and rows.
const MIN_TIME_S: f64 = 0.3;
const MIN_CORRELATED_ROWS: f64 = 2.0;

/// Maximum lag of the autocorrelation, and its minimum number of rows.
const LARGEST_LAG: usize = 200;
const MIN_LENGTH: usize = 100;

/// The slow component on these rows; `None` also without time, or for more than two outputs.
pub(super) fn slow_error(
    model: &Model,
    recording: &Recording,
    rows: &[usize],
) -> Option<SlowErrorParameters> {
    if recording.outputs().len() > 2 || rows.len() < MIN_LENGTH {
        return None;
    }
    let predicted = predictions(model, recording);
    let all = recording.rows();
    let errors = rows.iter().map(|row| {
        let (seen, expected) = (&all[*row].outputs, &predicted[*row]);
        [seen[0] - expected[0], seen[1] - expected[1]]
    });
    let errors: Vec<[f64; 2]> = errors.collect();
    let (direction, along, across) = principal(&errors);
    let share = along / (along + across);
    // Held-out rows come in blocks: the usual interval is that within a block.
    let times: Vec<f64> = rows.iter().filter_map(|row| all[*row].time_s).collect();
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let interval_s = median(&mut intervals)?;
    let series: Vec<f64> =
        errors.iter().map(|error| direction[0] * error[0] + direction[1] * error[1]).collect();
    let time_rows = correlation_time(&series)?;
    let is_slow = time_rows >= MIN_CORRELATED_ROWS && time_rows * interval_s >= MIN_TIME_S;
    (share >= MIN_SHARE && is_slow && interval_s > 0.0).then_some(SlowErrorParameters {
        direction,
        deviation: along.sqrt(),
        time_constant_s: time_rows * interval_s,
        rest: across.sqrt(),
        fast: Some(fast_part(&series).sqrt()),
    })
}

/// The variance of the changes from row to row: the autocovariance of the rest falls exponentially,
/// so its values at lags of one and two rows show its value at lag 0.
fn fast_part(series: &[f64]) -> f64 {
    let covariance = |lag: usize| products(series, lag) / series.len() as f64;
    let [all, one, two] = [0, 1, 2].map(covariance);
    if two > 0.0 { (all - one * one / two).max(0.0) } else { all }
}

/// Sum of the products of values that are this many rows apart.
fn products(series: &[f64], lag: usize) -> f64 {
    series.iter().zip(series.get(lag..).unwrap_or_default()).map(|(a, b)| a * b).sum()
}

/// The direction of the largest variance around 0, and the variances along and across it.
fn principal(errors: &[[f64; 2]]) -> ([f64; 2], f64, f64) {
    let product = |[a, b]: &[f64; 2]| Matrix2::new(a * a, a * b, a * b, b * b);
    let variances = errors.iter().map(product).sum::<Matrix2<f64>>() / errors.len() as f64;
    let found = variances.symmetric_eigen();
    let along = found.eigenvalues.imax();
    let direction = found.eigenvectors.column(along);
    let across = found.eigenvalues[1 - along].max(0.0);
    ([direction[0], direction[1]], found.eigenvalues[along], across)
}

/// The number of rows after which the autocorrelation around 0 has fallen to 1/e.
fn correlation_time(series: &[f64]) -> Option<f64> {
    let square = products(series, 0);
    let correlation = |lag: usize| {
        let scale = series.len() as f64 / (series.len() - lag) as f64;
        scale * products(series, lag) / square
    };
    let limit = (-1.0_f64).exp();
    let mut before = 1.0;
    for lag in 1..LARGEST_LAG.min(series.len() / 2) {
        let now = correlation(lag);
        if now.is_nan() {
            return None;
        }
        if now < limit {
            return Some(lag as f64 - (limit - now) / (before - now));
        }
        before = now;
    }
    Some(LARGEST_LAG as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow number along a direction, and a fast one across it.
    fn errors(direction: [f64; 2]) -> Vec<[f64; 2]> {
        let mut slow = 0.0;
        let mut state = 1_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
        };
        let next = |_| {
            slow += -0.05 * slow + noise();
            let fast = 0.3 * noise();
            [slow * direction[0] - fast * direction[1], slow * direction[1] + fast * direction[0]]
        };
        (0..20_000).map(next).collect()
    }

    #[test]
    fn direction_and_correlation_time_are_found() {
        let (direction, along, across) = principal(&errors([-0.8, 0.6]));
        let cosine = (direction[0] * -0.8 + direction[1] * 0.6).abs();
        assert!(cosine > 0.999, "{direction:?}");
        assert!(along > 20.0 * across, "{along} {across}");
        let series: Vec<f64> = errors([1.0, 0.0]).iter().map(|error| error[0]).collect();
        let time = correlation_time(&series).unwrap();
        assert!((16.0..25.0).contains(&time), "{time}");
    }

    #[test]
    fn fast_and_slow_variance_are_separated() {
        let all = errors([1.0, 0.0]);
        let slow: Vec<f64> = all.iter().map(|error| error[0]).collect();
        // Uniform between -0.5 and 0.5: a variance of 1/12.
        assert!(fast_part(&slow) < 0.02, "{}", fast_part(&slow));
        let both: Vec<f64> = all.iter().map(|error| error[0] + error[1] / 0.3).collect();
        let found = 12.0 * fast_part(&both);
        assert!((0.7..1.3).contains(&found), "{found}");
    }
}
