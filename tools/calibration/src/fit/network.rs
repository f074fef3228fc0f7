//! Networks trained elsewhere: from their file and a recording to a model.
//!
//! The recording provides what the file of a network lacks: the hull, the straight line beyond a
//! step, the deviation on the held-out rows, and the motion after which it forgets the past.

use std::path::Path;

use i2ris::file_permissions::MAX_MODEL_BYTES;
use i2ris::model::file::{FamilyParameters, OutputSpec};
use i2ris::model::network::NetworkParameters;
use i2ris::model::{Memory, Model};
use i2ris::units::MotorVec;
use serde::{Deserialize, Serialize};

use super::all_families::{Training, training};
use super::error::FitError;
use super::model_file::Fitted;
use super::network_error::NetworkError;
use super::options::FitOptions;
use crate::recording::Recording;
use crate::regression::linear::LinearFit;

/// The format of the file of a network.
pub const NETWORK_FORMAT: &str = "i2ris-network";

/// The version of that format.
const VERSION: u32 = 1;

/// Minimum length of the recording, steps.
const MIN_STEPS: usize = 50;

/// Maximum error on the held-out rows, relative to that of a straight line.
const MAX_ERROR_RATIO: f64 = 1.05;

/// A network as written by its converter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkFile {
    /// [`NETWORK_FORMAT`].
    pub format: String,
    /// 1.
    pub version: u32,
    /// Inputs: `q0_counts`, `q1_counts`.
    pub inputs: Vec<String>,
    /// Outputs.
    pub outputs: Vec<OutputSpec>,
    /// The layers.
    pub network: NetworkParameters,
}

impl NetworkFile {
    /// Reads the file of a network.
    ///
    /// # Errors
    ///
    /// The file is too long, or not a supported network.
    pub fn read(path: &Path) -> Result<Self, NetworkError> {
        let named = |source| NetworkError::Read { path: path.to_owned(), source };
        let length = std::fs::metadata(path).map_err(named)?.len();
        if length > MAX_MODEL_BYTES {
            let (path, megabytes) = (path.to_owned(), length >> 20);
            return Err(NetworkError::TooLong { path, megabytes });
        }
        let text = std::fs::read_to_string(path).map_err(named)?;
        let parsed = serde_json::from_str(&text);
        parsed.map_err(|source| NetworkError::Json { path: path.to_owned(), source })
    }

    fn check(&self, recording: &Recording) -> Result<(), NetworkError> {
        if self.format != NETWORK_FORMAT || self.version != VERSION {
            let found = format!("{} {}", self.format, self.version);
            return Err(NetworkError::Format { found });
        }
        let names = |inputs: Vec<String>, outputs: &[OutputSpec]| {
            let outputs = outputs.iter().map(|output| format!("{}_{}", output.name, output.unit));
            format!("{} to {}", inputs.join(", "), outputs.collect::<Vec<_>>().join(", "))
        };
        let counts = (0..recording.motors()).map(|motor| format!("q{motor}_counts")).collect();
        let wanted = names(counts, recording.outputs());
        let found = names(self.inputs.clone(), &self.outputs);
        if found != wanted {
            return Err(NetworkError::Columns { found, wanted });
        }
        let step_counts = self.network.step_counts;
        let least = self.network.window_steps().unwrap_or(0).max(MIN_STEPS);
        let steps = (travel(recording) / step_counts) as usize;
        if steps < least {
            return Err(NetworkError::Window { steps, step_counts, least });
        }
        Ok(())
    }
}

/// Travel of the fastest motor, from position to position, counts.
fn travel(recording: &Recording) -> f64 {
    let pairs = recording.path().windows(2);
    let moved = |pair: &[crate::recording::PathPoint]| {
        let [a, b] = [pair[0].counts, pair[1].counts];
        (b[0] - a[0]).abs().max((b[1] - a[1]).abs())
    };
    pairs.map(moved).sum()
}

/// Makes a model from a network: checked like in the controller, and measured.
///
/// # Errors
///
/// The network is refused, or the recording determines no hull; see [`NetworkError`].
pub fn import(
    file: &NetworkFile,
    recording: &Recording,
    options: &FitOptions,
) -> Result<Model, FitError> {
    file.check(recording)?;
    training(recording, options, |training| {
        let Training { context, straight, .. } = training;
        let parameters = |memory_counts: Vec<f64>| {
            Fitted::plain(FamilyParameters::Network {
                network: file.network.clone(),
                memory_counts,
                gain: straight.gain.clone(),
                covariance: straight.covariance.clone(),
            })
        };
        let refused = |error| FitError::Network(NetworkError::Refused(error));
        let ranges = vec![0.0; recording.motors()];
        let first = context.model(&parameters(ranges)).map_err(refused)?;
        let errors = first.file().metrics.iter().map(|it| it.held_out.unwrap_or(it.training));
        let error = errors.map(|fit| fit.rmsd.powi(2)).sum::<f64>().sqrt();
        let straight = rms(straight, recording, &context.held_out_or_training());
        if error.is_nan() || error > MAX_ERROR_RATIO * straight {
            return Err(NetworkError::WorseThanLinear { error, straight }.into());
        }
        context.model(&parameters(forgets(&first))).map_err(refused)
    })
}

/// RMS error of the straight line on some rows.
fn rms(straight: &LinearFit, recording: &Recording, rows: &[usize]) -> f64 {
    let errors = rows.iter().map(|row| {
        let row = &recording.rows()[*row];
        let pairs = straight.predict(&row.counts).zip(&row.outputs);
        pairs.map(|(found, measured)| (found - measured).powi(2)).sum::<f64>()
    });
    (errors.sum::<f64>() / rows.len() as f64).sqrt()
}

/// Parts of the hull that are tried, and positions per turn through the hull.
const PARTS: usize = 10;
const PER_TURN: usize = 200;

/// The range of every motor after which the model forgets its past: two memories with opposite
/// pasts agree within a standard deviation of the model.
fn forgets(model: &Model) -> Vec<f64> {
    let centre = model.hull().centre();
    let reach = |motor: usize| {
        let corners = model.hull().corners().map(|corner| (corner[motor] - centre[motor]).abs());
        corners.fold(0.0, f64::max)
    };
    let reach: MotorVec = [reach(0), if model.motors() > 1 { reach(1) } else { 0.0 }];
    let at = |size: [f64; 2]| {
        let counts = std::array::from_fn(|motor| centre[motor] + size[motor] * reach[motor]);
        model.hull().project(&counts)
    };
    let from = |side: f64| {
        let mut memory = model.new_memory();
        for position in 0..=PER_TURN {
            let left = side * (1.0 - position as f64 / PER_TURN as f64);
            model.advance(&mut memory, &at([left, left]));
        }
        memory
    };
    let (one, other) = (from(1.0), from(-1.0));
    let agree = |size: f64| {
        let turned = |memory: &Memory| {
            let mut memory = *memory;
            for position in 0..=2 * PER_TURN {
                let angle = std::f64::consts::TAU * position as f64 / PER_TURN as f64;
                model.advance(&mut memory, &at([size * angle.sin(), size * (0.5 * angle).sin()]));
            }
            model.predict(&centre, &memory)
        };
        let (one, other) = (turned(&one), turned(&other));
        let pairs = one.mean.iter().zip(other.mean).zip(one.deviation());
        pairs.take(model.outputs()).all(|((a, b), deviation)| (a - b).abs() <= deviation)
    };
    let parts = (1..PARTS).map(|part| part as f64 / PARTS as f64);
    let part = parts.clone().find(|size| agree(*size)).unwrap_or(1.0);
    reach.iter().take(model.motors()).map(|reach| 2.0 * part * reach).collect()
}

#[cfg(test)]
mod tests;
