//! What a fit found out: one value, which is printed, written as JSON, and shown on a page.

use std::ops::Range;

use i2ris::model::file::OutputMetrics;
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use serde::Serialize;

use super::mixture_figure::PlanarMixture;
use crate::hand_limits::HandLimits;
use crate::quality::latency::Latency;
use crate::quality::residual_pattern::Unexplained;
use crate::quality::{NoiseFloor, Spike};
use crate::recording::ReadReport;

/// The family that others are compared with.
pub(super) const BASELINE: &str = "linear";

/// The memoryless mixture: what a model with memory has to be better than.
const MEMORYLESS: &str = "gmr";

/// What a fit found out, in the unit of the recording throughout. Its `Display` is the printed
/// report, at most 100 columns wide; [`html`](Self::html) is the page.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct CalibrationReport {
    pub(super) robot_id: String,
    /// Date and time of the recording, UTC.
    pub(super) recorded_at: Option<String>,
    /// SHA-256 of the canonical form of the model that was written, hexadecimal.
    pub(super) model_id: String,
    pub(super) recording: RecordingFacts,
    pub(super) outputs: Vec<OutputFacts>,
    pub(super) spikes: Vec<Spike>,
    /// How late the outputs are stamped, if that stands out of its uncertainty.
    pub(super) latency: Option<Latency>,
    /// Taken off the stamps of the outputs before the fit, s.
    pub latency_taken_off_s: Option<f64>,
    /// Limits of the recording.
    pub(super) warnings: Vec<String>,
    /// Families that were fitted, the simplest first.
    pub(super) families: Vec<FamilyResult>,
    /// Families that could not be fitted, and why.
    pub(super) failures: Vec<(String, String)>,
    /// Whether the chosen family was chosen by its error on the rows held out: that error then
    /// flatters it.
    pub(super) chosen_by_held_out: bool,
    /// The scores that the family was chosen by; none where it was asked for.
    pub(super) choice: Vec<ChoiceScore>,
    /// The part of the measured rows whose poses the robot may go to, percent.
    pub(super) usable_percent: f64,
    /// Hand that the limits of a configuration bear by default.
    pub(super) hand: Option<HandLimits>,
    /// Why the error in use will be above what the model states, if it will.
    pub(super) beyond_model: Option<String>,
    /// What the chosen model leaves beyond the noise.
    pub(super) unexplained: Option<Unexplained>,
    /// How it was fitted: names and values.
    pub(super) settings: Vec<(String, String)>,
    /// The program that fitted the models, with its version.
    pub(super) software: String,
    #[serde(skip)]
    pub(super) track: Track,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct RecordingFacts {
    pub name: String,
    pub sha256: String,
    pub motors: usize,
    #[serde(flatten)]
    pub read: ReadReport,
    pub training: usize,
    /// Every so many-th row that could be used was.
    pub every: usize,
    pub held_out: usize,
    /// What was held out, in words: `the last of 3.97 cycles`.
    pub held_out_rows: String,
    /// Of the rows held out.
    pub held_out_flagged: usize,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct OutputFacts {
    pub name: String,
    pub unit: String,
    pub noise: Option<NoiseFloor>,
    /// Of the affine model, per count of each motor.
    pub gain: Vec<f64>,
    #[serde(skip)]
    pub straight: Straight,
}

/// The score of a family, in the unit of the outputs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct ChoiceScore {
    pub family: String,
    /// RMS length of the error on the rows held out.
    pub held_out: f64,
    /// RMS length of the tracking error of its inverse on the other families, and the name of the
    /// one where it is worst; `None` without another credible one.
    pub tracking: Option<(f64, String)>,
    /// How many times its error is that of the chosen family, as a logarithm: the mean over the
    /// blocks, and its standard error.
    pub beside: (f64, f64),
    /// Both together.
    pub total: f64,
    /// Travel of the motors, relative to that of `linear`.
    pub travel: f64,
    pub chosen: bool,
    /// All of it in a sentence.
    pub sentence: String,
}

/// A model and its predictions.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct FamilyResult {
    pub name: String,
    /// Its name, with the components of a mixture: `gmr (K = 5)`.
    pub title: String,
    /// What the fit took beside that: components that found no rows, smoothing.
    pub note: Option<String>,
    /// Whether this is the model that was written.
    pub chosen: bool,
    pub model_id: String,
    pub fit_seconds: f64,
    /// Of every output, as in its file.
    pub metrics: Vec<OutputMetrics>,
    pub training: Option<Errors>,
    pub held_out: Option<Errors>,
    /// What its parameters say about the robot, in lines.
    pub reading: Option<String>,
    /// Of every output.
    #[serde(skip)]
    pub branches: Vec<Branches>,
    #[serde(skip)]
    pub mixtures: Vec<PlanarMixture>,
}

/// Errors on a set of rows beyond those in the file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Errors {
    /// Root mean square of the length of the error over all outputs.
    pub rms_length: f64,
    /// Of every output: 99 of 100 rows are closer.
    pub p99: Vec<f64>,
}

impl FamilyResult {
    /// The errors that count: on the rows held out, or on those used for training where none are.
    pub fn judged(&self) -> Option<&Errors> {
        self.held_out.as_ref().or(self.training.as_ref())
    }
}

impl CalibrationReport {
    pub(super) fn chosen(&self) -> Option<&FamilyResult> {
        self.families.iter().find(|family| family.chosen)
    }

    pub(super) fn family(&self, name: &str) -> Option<&FamilyResult> {
        self.families.iter().find(|family| family.name == name)
    }

    /// What the chosen model is compared with in the figures: the memoryless mixture if there is
    /// one, otherwise the baseline; nothing if that is the chosen one.
    pub(super) fn reference(&self) -> Option<&FamilyResult> {
        let named = |name: &str| self.family(name).filter(|family| !family.chosen);
        named(MEMORYLESS).or_else(|| named(BASELINE))
    }

    /// The unit of all outputs.
    pub(super) fn unit(&self) -> &str {
        self.outputs.first().map_or("", |output| output.unit.as_str())
    }

    /// The length of the noise over all outputs, where all are known.
    pub(super) fn noise(&self) -> Option<f64> {
        let noise = self.outputs.iter().map(|output| Some(output.noise?.deviation));
        let noise: Option<Vec<f64>> = noise.collect();
        noise.map(|noise| noise.iter().map(|noise| noise * noise).sum::<f64>().sqrt())
    }
}

/// An affine function of the counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Straight {
    /// Per count of each motor.
    pub gain: MotorVec,
    /// At counts of 0.
    pub offset: f64,
}

impl Straight {
    pub fn at(&self, counts: &MotorVec) -> f64 {
        self.gain.iter().zip(counts).map(|(gain, count)| gain * count).sum::<f64>() + self.offset
    }

    /// The direction in motor space in which it is steepest, of length 1; motor 0 if it is flat.
    pub fn direction(&self) -> MotorVec {
        let length = self.gain.iter().map(|gain| gain * gain).sum::<f64>().sqrt();
        if length > 0.0 { self.gain.map(|gain| gain / length) } else { [1.0, 0.0] }
    }

    /// Counts along that direction.
    pub fn along(&self, counts: &MotorVec) -> f64 {
        self.direction().iter().zip(counts).map(|(part, count)| part * count).sum()
    }
}

/// Every row of a recording. All lists have one entry per row.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Track {
    /// Time since the first row, s; the number of the row where there are no time stamps.
    pub time: Vec<f64>,
    pub timed: bool,
    pub counts: Vec<MotorVec>,
    /// Whether the counts along each output were last seen going up.
    pub rising: Vec<[bool; MAX_OUTPUTS]>,
    pub measured: Vec<[f64; MAX_OUTPUTS]>,
    /// Indices of the rows used for training, in rising order.
    pub training: Vec<usize>,
    pub held_out: Vec<Range<usize>>,
    /// Rows whose poses the chosen model clips.
    pub clipped: Vec<usize>,
}

impl Track {
    pub fn held_out(&self) -> impl Iterator<Item = usize> + '_ {
        self.held_out.iter().cloned().flatten()
    }

    pub fn holds_nothing_out(&self) -> bool {
        self.held_out().next().is_none()
    }
}

/// Predictions of one output on a sweep back and forth: counts along the output, the output, and
/// the straight line.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Branches {
    pub rising: Vec<[f64; 3]>,
    pub falling: Vec<[f64; 3]>,
}
