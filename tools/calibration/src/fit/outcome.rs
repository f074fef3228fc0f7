//! Models and the report of their fit.

use std::error::Error;
use std::fmt;
use std::sync::Arc;

use i2ris::model::{Model, ModelError};

use super::choice::{Score, held_out_error};
use super::flatness::FlatSpot;
use super::metrics::predictions;
use super::network::NetworkError;
use super::options::Family;
use super::split::{Split, SplitError};
use crate::em::EmError;
use crate::families::force_balance::mechanism::BalanceMechanism;
use crate::families::play::play_fit::PlayMechanism;
use crate::quality::residual_pattern::Unexplained;
use crate::quality::{Finding, Quality};
use crate::recording::Recording;
use crate::regression::linear::LinearError;

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// Too many rows are held out.
    #[error(transparent)]
    Split(#[from] SplitError),
    /// The motors do not span their space.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// A network trained elsewhere is refused.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// An output never changes.
    #[error(
        "output `{output}` does not change in the rows used for training; record motion that \
         changes it, or hold out other rows"
    )]
    Constant {
        /// Name of the output.
        output: String,
    },
    /// No mixture.
    #[error(transparent)]
    Mixture(#[from] EmError),
    /// The parameters of the family cannot be found.
    #[error("family `{family}`: {source}")]
    Family {
        /// The family.
        family: Family,
        /// Cause.
        source: Box<dyn Error + Send + Sync>,
    },
    /// The mixture is flat somewhere.
    #[error("the mixture is refused: {0}; record more of that region")]
    TooFlat(FlatSpot),
    /// The recording cannot show hysteresis, and the family needs it.
    #[error("{0}")]
    NoHysteresis(Finding),
    /// On its training rows, the model is worse than a straight line.
    #[error(
        "on the training rows its error is {rms:.3}, that of a straight line \
         {linear_rms:.3}; take `linear`, or record motion with reversals of many sizes"
    )]
    WorseThanLinear {
        /// RMS length of its error, in the unit of the outputs.
        rms: f64,
        /// RMS length of the error of the straight line.
        linear_rms: f64,
    },
    /// On held-out rows the model is worse than the mean of the measurements.
    #[error(
        "the model of family `{family}` is worthless: {doubt}; record motion with reversals of \
         many sizes of both motors, or use --force to write it with a mark"
    )]
    Worthless {
        /// The family.
        family: Family,
        /// Cause.
        doubt: String,
    },
    /// A model that cannot be one more start.
    #[error(
        "the earlier calibration (--model) cannot be a start: {0}; name another one, or leave it \
         out"
    )]
    Earlier(String),
    /// No rows are held out for the choice.
    #[error(
        "choosing the best family, or an earlier calibration, needs held-out rows; name a family \
         with --family and no --model, or hold something out"
    )]
    NothingToChooseBy,
    /// The model is refused, as the controller would refuse it.
    #[error("the model of family `{family}` is refused: {source}")]
    Refused {
        /// The family.
        family: Family,
        /// Cause.
        source: Box<ModelError>,
    },
}

/// A model of a family that the controller would refuse.
pub(super) fn refused(family: Family, source: ModelError) -> FitError {
    FitError::Refused { family, source: Box::new(source) }
}

/// Models and the report of their fit.
#[derive(Debug)]
pub struct FitOutcome {
    /// The chosen model: checked, prepared, and measured on the recording.
    pub model: Arc<Model>,
    /// Its family.
    pub family: Family,
    /// The affine model of the same rows, for comparison. It is the same model if `family` is
    /// linear.
    pub linear: Arc<Model>,
    /// The result of every requested family, the simplest first.
    pub families: Vec<FamilyOutcome>,
    /// The report.
    pub report: FitReport,
}

/// The result of a family.
#[derive(Debug)]
pub struct FamilyOutcome {
    /// The family.
    pub family: Family,
    /// The model, or why there is none.
    pub result: Result<Arc<Model>, FitError>,
    /// Properties of the mechanism, if the family has them.
    pub mechanism: Option<Mechanism>,
    /// Additional note on the fit: remaining components, smoothing.
    pub note: Option<String>,
    /// Mean square error on blocks of its training rows that its search left out, one fold after
    /// the other; empty for families without folds.
    pub left_out: Vec<f64>,
    /// Duration, s; the only value that differs between runs.
    pub seconds: f64,
}

/// Properties of the mechanism, derived from parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum Mechanism {
    /// Mechanism of `gmr-play`.
    Plays(PlayMechanism),
    /// Mechanism of `force-balance`.
    Balance(BalanceMechanism),
}

impl fmt::Display for Mechanism {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plays(found) => found.fmt(f),
            Self::Balance(found) => found.fmt(f),
        }
    }
}

impl FamilyOutcome {
    /// Adds to the note.
    pub(super) fn note_also(&mut self, text: &str) {
        self.note =
            Some(self.note.take().map_or(text.to_owned(), |note| format!("{note}; {text}")));
    }
}

/// Report of a fit.
#[derive(Debug)]
pub struct FitReport {
    /// The held-out rows.
    pub split: Split,
    /// Properties of the recording alone.
    pub quality: Quality,
    /// Indices of the rows used for training.
    pub training: Vec<usize>,
    /// One of this many usable rows was used.
    pub every: usize,
    /// Held-out rows with known state, in blocks, for judging the families.
    pub judged: Vec<Vec<usize>>,
    /// Scores of the fitted families, the simplest first; empty if a family was requested.
    pub scores: Vec<Score>,
}

/// Another family explains a recording as well if its error is at most this many times as large.
const AS_WELL: f64 = 1.25;

impl FitOutcome {
    /// The chosen family as judged: without the held-out rows.
    fn judged(&self) -> Option<&Model> {
        let chosen = self.families.iter().find(|found| found.family == self.family)?;
        chosen.result.as_deref().ok()
    }

    /// The error of the chosen model beyond the noise on rows that it had not seen.
    #[must_use]
    pub fn unexplained(&self, recording: &Recording) -> Option<Unexplained> {
        let predicted = predictions(self.judged()?, recording);
        let rows = self.report.judged.concat();
        let has_memory = self.family.has_memory();
        Unexplained::find(recording, &self.report.quality, &predicted, &rows, has_memory)
    }

    /// Describes the robot by the parameters of a family, and names other families that explain the
    /// recording as well: the robot is not certain to be as one of them describes it.
    #[must_use]
    pub fn reading(&self, of: &FamilyOutcome) -> Option<String> {
        let mut text = of.mechanism.as_ref()?.to_string().trim_end().to_owned();
        let model = of.result.as_ref().ok()?;
        let unit = model.file().outputs.first()?.unit;
        let own = held_out_error(model);
        let mut others: Vec<(Family, f64)> = self
            .families
            .iter()
            .filter(|other| other.family != of.family && other.family.has_memory())
            .filter_map(|other| Some((other.family, held_out_error(other.result.as_ref().ok()?))))
            .filter(|(_, error)| *error <= AS_WELL * own)
            .collect();
        others.sort_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((other, error)) = others.first() {
            let how = if *error * AS_WELL < own { "better" } else { "as well" };
            let (error, own) = (error / unit.si(), own / unit.si());
            text += &format!(
                "\nbut {other} explains the rows held out {how} ({error:.3} {unit} against \
                 {own:.3} {unit}): these are parameters of a model, not measurements of the robot"
            );
        }
        Some(text)
    }
}
