//! The quality of a recording: its information, before any family is fitted.
//!
//! | file | contents |
//! |---|---|
//! | `noise` | noise of the measurement, and single wrong readings |
//! | `identifiability` | whether the motion can show hysteresis |
//! | `cycle` | the cycles of a repeating motion, also around a closed curve |
//! | [`latency`] | latency of the outputs' stamps |
//! | `latency_features` | hysteresis without time, for the latency; corrected stamps |
//! | `residual_pattern` | model errors beyond noise, and their patterns |

pub(crate) mod cycle;
mod identifiability;
pub mod latency;
mod latency_features;
mod noise;
pub(crate) mod residual_pattern;

use i2ris::model::file::OutputUnit;

use crate::recording::Recording;
use crate::regression::linear::{LinearError, fit_linear, independence};
use crate::series::Series;
use crate::table::DataTable;

pub use identifiability::Finding;
pub(crate) use identifiability::limits_of_path;
pub use noise::SpikeOptions;
pub(crate) use noise::{NoiseFloor, Spike};

use latency::Latency;
use noise::{noise_floor, spikes};

/// With less independent motion than this part, the effects of two motors are hard to separate.
const HARDLY_SEPARABLE: f64 = 0.1;

/// Properties of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Noise of each output, where it can be estimated.
    pub noise: Vec<Option<NoiseFloor>>,
    /// Readings that were flagged, in order of rows.
    pub spikes: Vec<Spike>,
    /// Latency of the outputs' stamps against the counts, if the motion shows it.
    pub latency: Option<Latency>,
    /// Limits of the recording.
    pub warnings: Vec<Finding>,
}

/// Minimum bend of a calibrated snake, deg; the largest angle in radians is smaller.
const MIN_BEND_DEG: f64 = 1.6;

impl Quality {
    /// Examines a recording. Fails if not even an affine model can be fitted to the motors.
    pub fn new(recording: &Recording, options: &SpikeOptions) -> Result<Self, LinearError> {
        let rows = recording.rows();
        let indices = || 0..rows.len();
        let inputs = inputs(recording, indices());
        let linear = fit_linear(&inputs, &outputs(recording, indices()))?;
        let warnings = findings(recording);
        let mut quality = Self { noise: Vec::new(), spikes: Vec::new(), latency: None, warnings };
        // If hysteresis looks like a shift in phase, a shift in time does as well.
        if quality.hides_hysteresis().is_none() {
            quality.latency = recording.latency();
        }
        for output in 0..recording.outputs().len() {
            let measured: Vec<f64> = rows.iter().map(|row| row.outputs[output]).collect();
            let predicted = |row| linear.predict(row).nth(output).unwrap_or_default();
            let pairs = measured.iter().zip(inputs.rows());
            let residuals: Vec<f64> = pairs.map(|(at, row)| at - predicted(row)).collect();
            let noise = noise_floor(rows, &measured, &residuals);
            let deviation = noise.map_or(0.0, |noise| noise.deviation);
            let spikes = spikes(rows, &residuals, output, &linear, deviation, options);
            quality.spikes.extend(spikes);
            quality.noise.push(noise);
        }
        quality.spikes.sort_by_key(|spike| (spike.row, spike.output));
        Ok(quality)
    }

    /// Why hysteresis cannot be found at all, if so.
    pub fn hides_hysteresis(&self) -> Option<Finding> {
        self.warnings.iter().find(|finding| finding.hides_hysteresis()).copied()
    }

    /// Why the recording lacks motion between the axes of the motors, if so.
    pub fn hides_plane(&self) -> Option<Finding> {
        self.warnings.iter().find(|finding| finding.hides_plane()).copied()
    }

    /// Whether a row was flagged, for any output.
    pub fn is_flagged(&self, row: usize) -> bool {
        self.spikes.binary_search_by_key(&row, |spike| spike.row).is_ok()
    }
}

/// All limits of a recording.
pub fn findings(recording: &Recording) -> Vec<Finding> {
    let independent = independence(&inputs(recording, 0..recording.rows().len()));
    let percent = 100.0 * independent;
    let hardly = (independent < HARDLY_SEPARABLE).then_some(Finding::HardlySeparable { percent });
    let limits = limits_of_path(&Series::whole(recording));
    hardly.into_iter().chain(maybe_radians(recording)).chain(limits).collect()
}

fn maybe_radians(recording: &Recording) -> Option<Finding> {
    let specs = recording.outputs();
    let angles = recording.rows().iter().flat_map(|row| &row.outputs[..specs.len()]);
    let furthest = angles.fold(0.0, |most: f64, angle| most.max(angle.abs()));
    let degrees = specs.iter().all(|spec| spec.unit == OutputUnit::Deg);
    (degrees && furthest < MIN_BEND_DEG).then_some(Finding::MaybeRadians { furthest })
}

/// The counts of some rows, one column per motor.
pub(crate) fn inputs(recording: &Recording, rows: impl IntoIterator<Item = usize>) -> DataTable {
    let counts = |index: usize| recording.rows()[index].counts;
    DataTable::from_rows(recording.motors(), rows.into_iter().map(counts))
}

/// The outputs of some rows, one column per output.
pub(crate) fn outputs(recording: &Recording, rows: impl IntoIterator<Item = usize>) -> DataTable {
    let outputs = |index: usize| recording.rows()[index].outputs;
    DataTable::from_rows(recording.outputs().len(), rows.into_iter().map(outputs))
}
