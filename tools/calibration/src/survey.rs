//! What a recording says before any model is chosen: noise, spikes, and what cannot be seen in it.

use std::fmt;

use crate::identify::{Finding, findings};
use crate::latency::Latency;
use crate::linear::{LinearError, LinearFit, fit_linear, independence};
use crate::noise::{NoiseFloor, noise_floor};
use crate::recording::Recording;
use crate::series::Series;
use crate::spike::{Spike, SpikeOptions, spikes};
use crate::table::Table;

/// Below this part of independent motion, the effects of two motors are told apart badly.
const HARDLY_SEPARABLE: f64 = 0.1;

/// What was found in a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// Noise of each output, where it can be told.
    pub noise: Vec<Option<NoiseFloor>>,
    /// Readings that were flagged, in order of rows.
    pub spikes: Vec<Spike>,
    /// How late the outputs are stamped against the counts, where the recording can tell that.
    pub latency: Option<Latency>,
    /// What to keep in mind.
    pub warnings: Vec<Warning>,
}

/// Something to keep in mind about a recording; no error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Warning {
    /// Hysteresis cannot be told from the shape of the curve, or not all of it.
    Hysteresis(Finding),
    /// Motors that move nearly as one.
    HardlySeparable {
        /// Part of the motion that is independent, percent.
        percent: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hysteresis(finding) => finding.fmt(f),
            Self::HardlySeparable { percent } => write!(
                f,
                "the motors move nearly together ({percent:.1} % of their motion is independent): their effects are \
                 told apart badly; record motion in which they move separately"
            ),
        }
    }
}

impl Survey {
    /// Looks through a recording.
    ///
    /// # Errors
    ///
    /// When the motors do not span their space, so that not even an affine model can be fitted.
    pub fn new(recording: &Recording, options: &SpikeOptions) -> Result<Self, LinearError> {
        let rows = recording.rows();
        let indices = || 0..rows.len();
        let inputs = inputs(recording, indices());
        let linear = fit_linear(&inputs, &outputs(recording, indices()))?;
        let warnings = warnings(recording, &inputs);
        let mut survey = Self {
            noise: Vec::new(),
            spikes: Vec::new(),
            latency: None,
            warnings,
        };
        // Where hysteresis looks like a shift in phase, a shift in time does too.
        survey.latency = if survey.hides_hysteresis().is_none() {
            recording.latency()
        } else {
            None
        };
        for output in 0..recording.outputs().len() {
            let measured: Vec<f64> = rows.iter().map(|row| row.outputs[output]).collect();
            let residuals = residuals(&measured, &inputs, &linear, output);
            let noise = noise_floor(rows, &measured, &residuals);
            let deviation = noise.map_or(0.0, |noise| noise.deviation);
            survey.spikes.extend(spikes(
                rows, &residuals, output, &linear, deviation, options,
            ));
            survey.noise.push(noise);
        }
        survey.spikes.sort_by_key(|spike| (spike.row, spike.output));
        Ok(survey)
    }

    /// Why hysteresis cannot be told at all, if it cannot.
    #[must_use]
    pub fn hides_hysteresis(&self) -> Option<Finding> {
        self.warnings.iter().find_map(|warning| match warning {
            Warning::Hysteresis(finding) if finding.hides_hysteresis() => Some(*finding),
            _ => None,
        })
    }

    /// Whether a row was flagged, for any output.
    #[must_use]
    pub fn is_flagged(&self, row: usize) -> bool {
        self.spikes.iter().any(|spike| spike.row == row)
    }
}

fn residuals(measured: &[f64], inputs: &Table, linear: &LinearFit, output: usize) -> Vec<f64> {
    let predicted = |counts| linear.predict(counts).nth(output).unwrap_or_default();
    measured
        .iter()
        .zip(inputs.rows())
        .map(|(measured, counts)| measured - predicted(counts))
        .collect()
}

fn warnings(recording: &Recording, inputs: &Table) -> Vec<Warning> {
    let independent = independence(inputs);
    let percent = 100.0 * independent;
    let hardly = (independent < HARDLY_SEPARABLE).then_some(Warning::HardlySeparable { percent });
    let rows: Vec<usize> = (0..recording.rows().len()).collect();
    let findings = findings(&Series::new(recording, &rows))
        .into_iter()
        .map(Warning::Hysteresis);
    hardly.into_iter().chain(findings).collect()
}

/// The counts of some rows, one column per motor.
pub(crate) fn inputs(recording: &Recording, rows: impl IntoIterator<Item = usize>) -> Table {
    let counts = |index: usize| recording.rows()[index].counts;
    Table::from_rows(recording.motors(), rows.into_iter().map(counts))
}

/// The outputs of some rows, one column per output.
pub(crate) fn outputs(recording: &Recording, rows: impl IntoIterator<Item = usize>) -> Table {
    let outputs = |index: usize| recording.rows()[index].outputs;
    Table::from_rows(recording.outputs().len(), rows.into_iter().map(outputs))
}
