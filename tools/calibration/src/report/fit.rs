//! Report of a fit: one value, which is printed, written as JSON, and shown on a page.

use i2ris::model::file::OutputMetrics;
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use serde::Serialize;

use crate::hand_limits::HandLimits;
use crate::quality::latency::Latency;
use crate::quality::residual_pattern::Unexplained;
use crate::quality::{NoiseFloor, Spike};
use crate::recording::ReadReport;

/// The family that others are compared with, and the memoryless mixture for those with memory.
pub(super) const BASELINE: &str = "linear";
const MEMORYLESS: &str = "gmr";

/// Report of a fit, in the unit of the recording throughout. Its `Display` is the printed report,
/// at most 100 columns wide; [`html`](Self::html) is the page.
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
    /// Latency of the outputs' stamps by plays alone, which rows held out did not confirm.
    pub(super) latency: Option<Latency>,
    /// Correction of the outputs' stamps before the fit, s; `None` if held-out rows confirm none.
    pub latency_taken_off_s: Option<f64>,
    pub(super) warnings: Vec<String>,
    /// Families that were fitted, the simplest first.
    pub(super) families: Vec<FamilyResult>,
    /// Families that could not be fitted, and why.
    pub(super) failures: Vec<(String, String)>,
    /// Whether the family was chosen by its held-out error, which is then too optimistic.
    pub(super) chosen_by_held_out: bool,
    /// The scores of the choice; empty if a family was requested.
    pub(super) choice: Vec<ChoiceScore>,
    /// Percentage of the measured rows whose poses the robot may use.
    pub(super) usable_percent: f64,
    /// Hand motion within the default limits of a configuration.
    pub(super) hand: Option<HandLimits>,
    /// Why the error in use will be larger than the model states, if so.
    pub(super) beyond_model: Option<String>,
    /// The error of the chosen model beyond the noise.
    pub(super) unexplained: Option<Unexplained>,
    pub(super) settings: Vec<(String, String)>,
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
    /// One of this many usable rows was used.
    pub every: usize,
    pub held_out: usize,
    /// Description of the held-out rows: `the last of 3.97 cycles`, and how many do not count.
    pub held_out_rows: String,
    pub held_out_flagged: usize,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct OutputFacts {
    pub name: String,
    pub unit: String,
    pub noise: Option<NoiseFloor>,
    /// Gain of the affine model, per count of each motor.
    pub gain: Vec<f64>,
    #[serde(skip)]
    pub straight: Straight,
}

/// The score of a family, in the unit of the outputs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct ChoiceScore {
    pub family: String,
    /// RMS length of the error on the held-out rows.
    pub held_out: f64,
    /// RMS length of the tracking error of its inverse on the other families, and the name of the
    /// family with the largest error; `None` if there is no other credible one.
    pub tracking: Option<(f64, String)>,
    /// Logarithm of its error relative to the chosen family over blocks: mean and standard error.
    pub beside: (f64, f64),
    pub total: f64,
    /// Relative to that of `linear`.
    pub travel: f64,
    pub chosen: bool,
    pub sentence: String,
    #[serde(skip)]
    pub hides_plane: bool,
}

/// A mixture over counts in a direction of the motors and one output.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlanarMixture {
    pub(super) output: usize,
    /// Direction of the counts, of length 1.
    pub(super) direction: MotorVec,
    /// Weight, mean, and the variances of counts and output with their covariance between them.
    pub(super) components: Vec<(f64, [f64; 2], [f64; 3])>,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct FamilyResult {
    pub name: String,
    /// Its name, with the components of a mixture: `gmr (K = 5)`.
    pub title: String,
    /// Additional note on the fit: components without rows, smoothing.
    pub note: Option<String>,
    /// Whether this is the model that was written.
    pub chosen: bool,
    pub model_id: String,
    pub fit_seconds: f64,
    pub metrics: Vec<OutputMetrics>,
    pub training: Option<Errors>,
    pub held_out: Option<Errors>,
    pub reading: Option<String>,
    #[serde(skip)]
    pub branches: Vec<Branches>,
    #[serde(skip)]
    pub mixtures: Vec<PlanarMixture>,
}

/// Errors on a set of rows beyond those in the file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Errors {
    pub rms_length: f64,
    pub p99: Vec<f64>,
}

impl FamilyResult {
    /// The errors that count: on the held-out rows, or on the training rows if none are held out.
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

    /// Reference in the figures: the memoryless mixture, or else the baseline, unless chosen.
    pub(super) fn reference(&self) -> Option<&FamilyResult> {
        let named = |name: &str| self.family(name).filter(|family| !family.chosen);
        named(MEMORYLESS).or_else(|| named(BASELINE))
    }

    pub(super) fn unit(&self) -> &str {
        self.outputs.first().map_or("", |output| output.unit.as_str())
    }

    /// Noise length over all outputs, if all are known.
    pub(super) fn noise(&self) -> Option<f64> {
        let squares = self.outputs.iter().map(|output| Some(output.noise?.deviation.powi(2)));
        squares.sum::<Option<f64>>().map(f64::sqrt)
    }
}

/// An affine function of the counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Straight {
    /// Slope per count of each motor.
    pub gain: MotorVec,
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

    pub fn along(&self, counts: &MotorVec) -> f64 {
        self.direction().iter().zip(counts).map(|(part, count)| part * count).sum()
    }
}

/// Every row of a recording. All lists have one entry per row.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Track {
    /// Time since the first row, s, or the row number if there are no time stamps.
    pub time: Vec<f64>,
    pub timed: bool,
    pub counts: Vec<MotorVec>,
    /// Whether the counts along each output rose last.
    pub rising: Vec<[bool; MAX_OUTPUTS]>,
    pub measured: Vec<[f64; MAX_OUTPUTS]>,
}

/// A sweep back and forth: counts along the output, prediction, and the straight line.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Branches {
    pub rising: Vec<[f64; 3]>,
    pub falling: Vec<[f64; 3]>,
}
