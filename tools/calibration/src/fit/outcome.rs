//! Models and the report of their fit.

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use std::{fmt, io};

use i2ris::file_permissions::MAX_MODEL_BYTES;
use i2ris::model::file::OutputUnit;
use i2ris::model::{Model, ModelError};
use i2ris_report::statistics::min_max;

use super::choice::{Score, held_out_error};
use super::flatness::FlatSpot;
use super::metrics::{along, clipped_rows, predictions};
use super::options::Family;
use super::split::{Split, SplitError};
use crate::em::EmError;
use crate::families::force_balance::mechanism::BalanceMechanism;
use crate::families::play::play_fit::PlayMechanism;
use crate::quality::residual_pattern::Unexplained;
use crate::quality::{Finding, Quality};
use crate::recording::Recording;
use crate::regression::linear::LinearError;

/// Any error below this part of the output range passes: on a straight snake all families are good.
pub(super) const MIN_NRMSD: f64 = 0.01;

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
    /// The controller would refuse it as well.
    #[error("the model of family `{family}` is refused: {source}")]
    Refused { family: Family, source: Box<ModelError> },
}

/// Why a network is refused. Errors are RMS, in the unit of the outputs.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum NetworkError {
    #[error("cannot read network {path}: {source}")]
    Read { path: PathBuf, source: io::Error },
    #[error("network {path} has {megabytes} MB; at most {} MB are read", MAX_MODEL_BYTES >> 20)]
    TooLong { path: PathBuf, megabytes: u64 },
    #[error("network {path}: {source}")]
    Json { path: PathBuf, source: serde_json::Error },
    #[error(
        "is not a network of this version: `{0}`; write it with i2ris.model.from_torch or \
         from_onnx"
    )]
    Format(String),
    #[error(
        "the network goes from {found}, and the recording from {wanted}: train it on those \
         columns, in that order, from counts to angles in degrees"
    )]
    Columns { found: String, wanted: String },
    #[error(
        "the recording is {steps} steps of {step_counts} counts long, and the network looks at \
         {least}; record more, or train it on a shorter window"
    )]
    Window { steps: usize, step_counts: f64, least: usize },
    #[error(
        "on the held-out rows the error of the network is {error:.3}, that of a straight line \
         {straight:.3}: it was trained on another robot, in other units, or with other steps"
    )]
    WorseThanLinear { error: f64, straight: f64 },
    /// The controller would refuse it as well.
    #[error("the network {0}")]
    Refused(ModelError),
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
    /// Mean square error on training blocks that its search left out, by fold.
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
    /// Held-out rows that count: within the hull of the training rows, or all if most lie outside.
    pub counted: Vec<usize>,
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

/// Maximum error over the stated deviation, which holds 95 % of normal errors, and over the noise.
const MAX_RATIO: f64 = 2.0;
const MAX_NOISES: f64 = 5.0;

/// Evidence for an error in use above twice the deviation that the model states, or far above the
/// noise, unit of the outputs.
///
/// The robot and the adaptation trust that deviation. Two signs at the end of a fit show that it is
/// too small: measured poses that the inverse does not reach, and another family that explains the
/// recording, but on which the inverse fails. An error far above the noise has another cause:
/// something in the recording is wrong, or no family represents the snake.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelMismatch {
    unit: OutputUnit,
    stated: f64,
    /// RMS distance of measured poses from the reached ones; unreachable poses, percent.
    clipped: (f64, f64),
    /// Remaining error of the inverse on the nearest of the other families.
    other: Option<(f64, Family)>,
    noisy: Option<Noisy>,
}

/// Error on held-out rows far above the noise.
#[derive(Debug, Clone, PartialEq)]
struct Noisy {
    /// Unit of the outputs.
    error: f64,
    /// Relative to the noise.
    ratio: f64,
    tried: Vec<(Family, f64)>,
}

impl ModelMismatch {
    /// Evidence that the error will exceed twice the stated deviation, or five times the noise.
    pub fn find(outcome: &FitOutcome, recording: &Recording) -> Option<Self> {
        let unit = outcome.model.file().outputs.first()?.unit;
        let (rows, model) = (recording.rows().len() as f64, &*outcome.model);
        let mut variance = 0.0;
        along(model, recording, |row, memory| {
            let stated = model.predict(&recording.rows()[row].counts, memory).deviation();
            variance += stated.iter().map(|it| it.powi(2)).sum::<f64>() / rows;
        });
        let clipped = clipped_rows(model, recording);
        let off = clipped.iter().map(|(_, off)| off.powi(2)).sum::<f64>() / rows;
        let score = |score: &&Score| score.family == outcome.family;
        let other = outcome.report.scores.iter().find(score).and_then(|score| score.nearest);
        let si = unit.si();
        let found = Self {
            unit,
            stated: variance.sqrt() / si,
            clipped: (off.sqrt() / si, 100.0 * clipped.len() as f64 / rows),
            other: other.map(|(error, family)| (error / si, family)),
            noisy: noisy(outcome, recording),
        };
        let is_beyond = found.reasons().next().is_some() || found.noisy.is_some();
        is_beyond.then_some(found)
    }

    fn reasons(&self) -> impl Iterator<Item = String> {
        let Self { unit, stated, clipped: (off, percent), other, .. } = *self;
        let most = MAX_RATIO * stated;
        let range = (stated.hypot(off) > most).then(|| {
            format!(
                "{percent:.1} % of the measured poses are beyond its reach, {off:.3} {unit} over \
                 all: record again, with both motors over all of that range from the start"
            )
        });
        let other = other.filter(|(error, _)| *error > most).map(|(error, family)| {
            format!(
                "if {family} is right, which also explains the recording, the error will be \
                 {error:.3} {unit}: record longer, and compare both on a trial (i2ris calibrate \
                 compare)"
            )
        });
        [range, other].into_iter().flatten()
    }
}

/// `None` for errors that are a small part of the range.
fn noisy(outcome: &FitOutcome, recording: &Recording) -> Option<Noisy> {
    let Unexplained { error, noise, .. } = outcome.unexplained(recording)?;
    let si = recording.outputs().first()?.unit.si();
    let ranges = (0..recording.outputs().len()).map(|output| {
        let (low, high) = min_max(recording.rows().iter().map(|row| row.outputs[output]));
        (high - low).powi(2)
    });
    let range = ranges.sum::<f64>().sqrt();
    let tried: Vec<_> = outcome
        .families
        .iter()
        .filter_map(|found| Some((found.family, held_out_error(found.result.as_ref().ok()?) / si)))
        .collect();
    let chosen = tried.iter().find(|(family, _)| *family == outcome.family);
    let error = chosen.map_or(error, |(_, error)| *error);
    let is_far = error > MAX_NOISES * noise && error > MIN_NRMSD * range;
    is_far.then(|| Noisy { error, ratio: error / noise, tried })
}

impl fmt::Display for ModelMismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { unit, stated, noisy, .. } = self;
        let mut reasons = self.reasons().peekable();
        if reasons.peek().is_some() {
            write!(
                f,
                "the model cannot represent this snake: its error will exceed twice the \
                 {stated:.3} {unit} that the model states"
            )?;
        }
        reasons.try_for_each(|reason| write!(f, "; {reason}"))?;
        let Some(Noisy { error, ratio, tried }) = noisy else { return Ok(()) };
        if self.reasons().next().is_some() {
            f.write_str("; ")?;
        }
        write!(f, "the error on rows held out, {error:.3} {unit}, is {ratio:.0} times the noise")?;
        for (place, (family, error)) in tried.iter().enumerate() {
            let before = if place == 0 { "; tried:" } else { "," };
            write!(f, "{before} {family} with {error:.3} {unit}")?;
        }
        f.write_str(match tried.iter().any(|(family, _)| family.has_memory()) {
            true => "; repair what `residual` names, then record again",
            false => "; also fit the families with memory (--family best)",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_contains;

    #[test]
    fn twice_the_stated_deviation_is_reported_with_a_remedy() {
        let found = |off, other| ModelMismatch {
            unit: OutputUnit::Deg,
            stated: 0.3,
            clipped: (off, 12.0),
            other: Some((other, Family::GmrPlay)),
            noisy: None,
        };
        assert_eq!(found(0.4, 0.5).reasons().next(), None);
        for (found, reason) in [
            (found(0.6, 0.5), "12.0 % of the measured poses are beyond its reach, 0.600 deg"),
            (found(0.0, 0.7), "if gmr-play is right, which also explains the recording"),
        ] {
            assert_eq!(found.reasons().count(), 1, "{found}");
            assert_contains(&found, &["cannot represent this snake", "0.300 deg", reason]);
        }
    }

    #[test]
    fn errors_far_above_the_noise_are_reported_with_attempts() {
        let (unit, clipped) = (OutputUnit::Deg, (0.0, 0.0));
        let tried = vec![(Family::Linear, 4.1), (Family::GmrPlay, 0.9)];
        let noisy = Some(Noisy { error: 0.9, ratio: 18.0, tried });
        let found = ModelMismatch { unit, stated: 0.9, clipped, other: None, noisy };
        let tried = "tried: linear with 4.100 deg, gmr-play with 0.900 deg; repair what `residual`";
        assert_contains(&found, &["0.900 deg, is 18 times the noise", tried]);
        assert!(!found.to_string().contains("cannot represent"), "{found}");
    }
}
