//! The content of a report.

use i2ris::units::{MAX_OUTPUTS, MotorVec};

/// The content of a report. Outputs are in the unit of the recording throughout.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReportData {
    /// The heading.
    pub title: String,
    /// The recording.
    pub recording: RecordingFacts,
    /// What was measured, 1 to 3.
    pub outputs: Vec<OutputFacts>,
    /// Every row of the recording.
    pub track: Track,
    /// The models, in the order of the tables.
    pub families: Vec<FamilyResult>,
    /// The mixture of the chosen family, one view per output; none if it has no mixture.
    pub read_out: Vec<ReadOutView>,
    /// Whether the chosen family was chosen by its error on the rows held out: that error then
    /// flatters it.
    pub chosen_by_held_out: bool,
    /// The scores that the family was chosen by; none where it was asked for.
    pub choice: Vec<ChoiceScore>,
    /// How it was fitted: names and values.
    pub settings: Vec<(String, String)>,
    /// Warnings, in whole sentences.
    pub warnings: Vec<String>,
    /// The program that fitted the models, with its version.
    pub software: String,
}

/// The score of a family, in the unit of the outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct ChoiceScore {
    /// Its name.
    pub family: String,
    /// RMS length of the error on the rows held out.
    pub held_out: f64,
    /// RMS length of the tracking error of its inverse on the worst of the other families, and the
    /// name of that one; `None` without another credible one.
    pub worst_plant: Option<(f64, String)>,
    /// Both together.
    pub total: f64,
    /// Travel of the motors, relative to that of `linear`.
    pub travel: f64,
    /// Whether it was taken.
    pub chosen: bool,
}

/// A recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordingFacts {
    /// Name of the file.
    pub name: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// The robot.
    pub robot_id: String,
    /// Number of motors, 1 or 2.
    pub motors: usize,
    /// What was held out, in words: `the last of 3.97 cycles`.
    pub held_out: String,
    /// More about it: names and values.
    pub more: Vec<(String, String)>,
}

/// A measured output.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OutputFacts {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Standard deviation of the noise of the measurement, where it is known.
    pub noise: Option<f64>,
    /// Its straight line.
    pub straight: Straight,
}

/// An affine function of the counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Straight {
    /// Per count of each motor.
    pub gain: MotorVec,
    /// At counts of 0.
    pub offset: f64,
}

impl Straight {
    /// Its value.
    #[must_use]
    pub fn at(&self, counts: &MotorVec) -> f64 {
        self.gain.iter().zip(counts).map(|(gain, count)| gain * count).sum::<f64>() + self.offset
    }

    /// The direction in motor space in which it is steepest, of length 1; motor 0 if it is flat.
    #[must_use]
    pub fn direction(&self) -> MotorVec {
        let length = self.gain.iter().map(|gain| gain * gain).sum::<f64>().sqrt();
        if length > 0.0 { self.gain.map(|gain| gain / length) } else { [1.0, 0.0] }
    }

    /// Counts along that direction.
    #[must_use]
    pub fn along(&self, counts: &MotorVec) -> f64 {
        self.direction().iter().zip(counts).map(|(part, count)| part * count).sum()
    }
}

/// Every row of a recording. All lists have one entry per row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Track {
    /// Time since the first row, s; the number of the row where there are no time stamps.
    pub time: Vec<f64>,
    /// Whether [`Track::time`] is one.
    pub timed: bool,
    /// Counts.
    pub counts: Vec<MotorVec>,
    /// Whether the counts along each output were last seen going up.
    pub rising: Vec<[bool; MAX_OUTPUTS]>,
    /// What was measured.
    pub measured: Vec<[f64; MAX_OUTPUTS]>,
    /// Indices of the rows used for training, in rising order.
    pub training: Vec<usize>,
    /// The first row held out; the number of rows if none is.
    pub held_out: Vec<std::ops::Range<usize>>,
}

impl Track {
    /// The rows held out.
    pub fn held_out(&self) -> impl Iterator<Item = usize> + '_ {
        self.held_out.iter().cloned().flatten()
    }

    /// Whether no rows are held out.
    #[must_use]
    pub fn holds_nothing_out(&self) -> bool {
        self.held_out().next().is_none()
    }

    /// The rows that the error of a fit counts on: those held out, or those used for training where
    /// none are.
    #[must_use]
    pub fn judged(&self) -> Vec<usize> {
        if self.holds_nothing_out() { self.training.clone() } else { self.held_out().collect() }
    }
}

/// A model and its predictions.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FamilyResult {
    /// Name of the family.
    pub name: String,
    /// Whether this is the model that was written.
    pub chosen: bool,
    /// SHA-256 of the canonical form of its file, hexadecimal.
    pub model_id: String,
    /// Components of its mixture, if it has one.
    pub components: Option<usize>,
    /// Mean log-likelihood per row, nats.
    pub log_likelihood: Option<f64>,
    /// Bayesian information criterion.
    pub bic: Option<f64>,
    /// How long the fit took, s.
    pub fit_seconds: Option<f64>,
    /// Its prediction at every row.
    pub predicted: Vec<[f64; MAX_OUTPUTS]>,
    /// Its branches, one entry per output.
    pub branches: Vec<Branches>,
}

/// Predictions of one output on a sweep back and forth: counts along the output, the output, and
/// the straight line.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Branches {
    /// With rising counts.
    pub rising: Vec<[f64; 3]>,
    /// With falling counts.
    pub falling: Vec<[f64; 3]>,
}

/// A mixture, seen along one output.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOutView {
    /// What the mixture takes in, with its unit.
    pub input: String,
    /// The rows used for training: input along the output, measured output.
    pub points: Vec<[f64; 2]>,
    /// Components, projected on the same plane.
    pub components: Vec<ProjectedComponent>,
    /// The regression through the middle of the region that was visited.
    pub section: Vec<SectionPoint>,
}

/// A Gaussian in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectedComponent {
    /// Its share, 0 to 1.
    pub weight: f64,
    /// Mean.
    pub mean: [f64; 2],
    /// Covariance.
    pub covariance: [[f64; 2]; 2],
}

/// The regression at one input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionPoint {
    /// Input along the output.
    pub along: f64,
    /// Expected output.
    pub mean: f64,
    /// Its standard deviation.
    pub deviation: f64,
}
