//! Models, and how they were found.

use std::fmt;
use std::sync::Arc;

use i2ris::model::Model;

use super::choice::{Score, held_out_error};
use super::error::FitError;
use super::family::Family;
use super::metrics::predictions;
use super::split::Split;
use crate::families::force_balance::mechanism::BalanceMechanism;
use crate::families::play_mechanism::PlayMechanism;
use crate::quality::Quality;
use crate::quality::residual_pattern::Unexplained;
use crate::recording::Recording;

/// Models, and how they were found.
#[derive(Debug)]
pub struct FitOutcome {
    /// The model that was taken: checked, prepared, and measured on the recording.
    pub model: Arc<Model>,
    /// Its family.
    pub family: Family,
    /// The affine model of the same rows, to compare with. It is the same model if `family` is
    /// linear.
    pub linear: Arc<Model>,
    /// The result of every family that was to be fitted, the simplest first.
    pub families: Vec<FamilyOutcome>,
    /// How the models were found.
    pub report: FitReport,
}

/// The result of a family.
#[derive(Debug)]
pub struct FamilyOutcome {
    /// Which.
    pub family: Family,
    /// The model, or why there is none.
    pub result: Result<Arc<Model>, FitError>,
    /// Properties of the mechanism, of families that show them.
    pub mechanism: Option<Mechanism>,
    /// What it took beside that: components that were left, smoothing.
    pub note: Option<String>,
    /// How long it took, s; the only thing here that is not the same in every run.
    pub seconds: f64,
}

/// Properties of the mechanism that parameters show.
#[derive(Debug, Clone, PartialEq)]
pub enum Mechanism {
    /// Of `gmr-play`.
    Plays(PlayMechanism),
    /// Of `force-balance`.
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

/// How models were found.
#[derive(Debug)]
pub struct FitReport {
    /// What was held out.
    pub split: Split,
    /// Properties of the recording alone.
    pub quality: Quality,
    /// Indices of the rows used for training.
    pub training: Vec<usize>,
    /// Every so many-th row that could be used was.
    pub every: usize,
    /// Rows held out whose state is known, in blocks: the families are judged by them.
    pub judged: Vec<Vec<usize>>,
    /// Scores of the families that could be fitted, the simplest first; none where a family was
    /// asked for.
    pub scores: Vec<Score>,
}

/// Another family explains a recording as well if its error is at most so many times as large.
const AS_WELL: f64 = 1.25;

impl FitOutcome {
    /// The chosen family as it was judged: without the rows held out.
    fn judged(&self) -> Option<&Model> {
        let chosen = self.families.iter().find(|found| found.family == self.family)?;
        chosen.result.as_deref().ok()
    }

    /// What the chosen model leaves beyond the noise on rows that it had not seen.
    #[must_use]
    pub fn unexplained(&self, recording: &Recording) -> Option<Unexplained> {
        let predicted = predictions(self.judged()?, recording);
        let rows = self.report.judged.concat();
        Unexplained::find(recording, &self.report.quality, &predicted, &rows)
    }

    /// What the parameters of a family say about the robot, and which other families explain the
    /// recording as well: the robot is not what one of them says while others say something else.
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
