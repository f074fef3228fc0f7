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

/// Why there is no model. Errors are RMS lengths in the unit of the outputs.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    #[error(transparent)]
    Split(#[from] SplitError),
    #[error(transparent)]
    Linear(#[from] LinearError),
    #[error(transparent)]
    Network(#[from] NetworkError),
    #[error(transparent)]
    Mixture(#[from] EmError),
    #[error(
        "output `{0}` does not change in the rows used for training; record motion that changes \
         it, or hold out other rows"
    )]
    Constant(String),
    /// The parameters of the family cannot be found.
    #[error("family `{family}`: {source}")]
    Family { family: Family, source: Box<dyn Error + Send + Sync> },
    #[error("the mixture is refused: {0}; record more of that region")]
    TooFlat(FlatSpot),
    #[error("{0}")]
    NoHysteresis(Finding),
    #[error(
        "on the training rows its error is {rms:.3}, that of a straight line \
         {linear_rms:.3}; take `linear`, or record motion with reversals of many sizes"
    )]
    WorseThanLinear { rms: f64, linear_rms: f64 },
    /// On held-out rows the model is worse than the mean of the measurements.
    #[error(
        "the model of family `{family}` is worthless: {doubt}; record motion with reversals of \
         many sizes of both motors, or use --force to write it with a mark"
    )]
    Worthless { family: Family, doubt: String },
    #[error(
        "the earlier calibration (--model) cannot be a start: {0}; name another one, or leave it \
         out"
    )]
    Earlier(String),
    #[error(
        "choosing the best family, or an earlier calibration, needs held-out rows; name a family \
         with --family and no --model, or hold something out"
    )]
    NothingToChooseBy,
    /// As the controller would refuse it.
    #[error("the model of family `{family}` is refused: {source}")]
    Refused { family: Family, source: Box<ModelError> },
}

pub(super) fn refused(family: Family, source: ModelError) -> FitError {
    FitError::Refused { family, source: Box::new(source) }
}

/// Models and the report of their fit.
#[derive(Debug)]
pub struct FitOutcome {
    /// The chosen model: checked, prepared, and measured on the recording.
    pub model: Arc<Model>,
    /// The chosen family.
    pub family: Family,
    /// The affine model of the same rows; the same model if `family` is linear.
    pub linear: Arc<Model>,
    /// The result of every requested family, the simplest first.
    pub families: Vec<FamilyOutcome>,
    /// The report.
    pub report: FitReport,
}

#[derive(Debug)]
pub struct FamilyOutcome {
    pub family: Family,
    pub result: Result<Arc<Model>, FitError>,
    pub mechanism: Option<Mechanism>,
    /// Additional note on the fit: remaining components, smoothing.
    pub note: Option<String>,
    /// Mean square error on training blocks that its search left out, fold by fold, if it has
    /// folds.
    pub left_out: Vec<f64>,
    /// Duration, s; the only value that differs between runs.
    pub seconds: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Mechanism {
    Plays(PlayMechanism),
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

pub(super) fn noted_also(note: Option<String>, text: &str) -> Option<String> {
    Some(note.map_or(text.to_owned(), |note| format!("{note}; {text}")))
}

#[derive(Debug)]
pub struct FitReport {
    pub split: Split,
    pub quality: Quality,
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
    pub fn unexplained(&self, recording: &Recording) -> Option<Unexplained> {
        let predicted = predictions(self.judged()?, recording);
        let rows = self.report.judged.concat();
        let has_memory = self.family.has_memory();
        Unexplained::find(recording, &self.report.quality, &predicted, &rows, has_memory)
    }

    /// Describes the robot by the parameters of a family, and names other families that explain the
    /// recording as well: the robot is not certain to be as one of them describes it.
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
