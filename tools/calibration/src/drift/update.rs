//! A new model from an old one and a short recording.

use i2ris::model::file::{ModelFile, OutputMetrics};
use i2ris::model::{Model, ModelError};

use super::estimate::{DriftError, DriftEstimate, length};
use super::regressors::points;
use crate::fit::metrics::metrics;
use crate::recording::Recording;

/// Of the recording, what is held out at its end to see whether the update helps there.
const HELD_OUT: f64 = 0.25;

/// The error there has to fall at least to this share: less is chance.
const WORTH_IT: f64 = 0.95;

/// A new model.
#[derive(Debug)]
pub struct Update {
    /// With the drift of the whole recording.
    pub model: Model,
    /// Of the whole recording.
    pub drift: DriftEstimate,
    /// RMS length of the error of the old model and of one made from the first part of the
    /// recording, on the rest.
    pub held_out: [f64; 2],
}

/// Why there is none.
#[derive(Debug, thiserror::Error)]
pub enum UpdateError {
    /// No drift is found.
    #[error(transparent)]
    Drift(#[from] DriftError),
    /// The model with the drift is refused.
    #[error("the model with the drift is refused: {0}; calibrate anew")]
    Model(#[from] ModelError),
    /// It would not be better.
    #[error(
        "an update from the first part of the recording is no better on the rest of it: {old:.3} \
         before, {new:.3} after; the calibration holds, or the drift is none of zero, gain and gap"
    )]
    NoBetter {
        /// RMS length of the error of the old model.
        old: f64,
        /// Of the new one.
        new: f64,
    },
}

/// Makes a model from an old one with the drift of a recording, which has the same motors and
/// outputs.
///
/// # Errors
///
/// [`UpdateError`].
pub fn update(old: &Model, recording: &Recording) -> Result<Update, UpdateError> {
    let rows = recording.rows().len();
    let first = rows - (HELD_OUT * rows as f64) as usize;
    let of_first = DriftEstimate::of_rows(old, recording, |row| row < first)?;
    let trial = built_in(old, &of_first)?;
    let errors = |model: &Model, from: usize| {
        let mut points = points(model, recording, &[1.0; 2]);
        points.retain(|point| point.row >= from);
        points
    };
    let rms = |model: &Model| {
        length(errors(model, first).iter().map(|point| {
            std::array::from_fn(|output| point.measured[output] - point.predicted[output])
        }))
    };
    let held_out = [rms(old), rms(&trial)];
    if held_out[1] > WORTH_IT * held_out[0] {
        let [old, new] = held_out;
        return Err(UpdateError::NoBetter { old, new });
    }
    let drift = DriftEstimate::new(old, recording)?;
    let mut file = built_in(old, &drift)?.file().clone();
    let measure = |model: &Model, from: usize, output: usize| {
        let points = errors(model, from);
        let pairs = points.iter().map(|it| (it.measured[output], it.predicted[output]));
        metrics(&pairs.collect::<Vec<_>>())
    };
    let model = Model::from_file(file.clone())?;
    for (output, figures) in file.metrics.iter_mut().enumerate() {
        if let Some(training) = measure(&model, 0, output) {
            *figures = OutputMetrics { training, held_out: measure(&trial, first, output) };
        }
    }
    note_origin(&mut file, recording, drift.rows);
    Ok(Update { model: Model::from_file(file)?, drift, held_out })
}

fn built_in(old: &Model, drift: &DriftEstimate) -> Result<Model, ModelError> {
    let unit = old.file().outputs[0].unit;
    Model::from_file(old.file().drifted(&drift.in_file(unit))?)
}

fn note_origin(file: &mut ModelFile, recording: &Recording, rows: usize) {
    // What a person has recorded is another calibration.
    file.built_in = None;
    let record = &mut file.training;
    record.data_file = format!("{} updated by {}", record.data_file, recording.name());
    record.data_sha256 = recording.sha256().to_owned();
    record.rows = rows;
    record.software = concat!("i2ris-calibration ", env!("CARGO_PKG_VERSION")).to_owned();
}
