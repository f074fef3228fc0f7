//! Models, and how they were found.

use std::fmt;
use std::sync::Arc;

use i2ris::model::Model;
use i2ris::model::file::OutputUnit;

use super::choice::Score;
use super::drift::Drift;
use super::error::FitError;
use super::family::Family;
use super::gmr::{Candidate, Verdict};
use super::split::Split;
use crate::families::play::play_mechanism::PlayMechanism;
use crate::families::stop::stop_mechanism::StopMechanism;
use crate::survey::overview::Survey;

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
    /// How long it took, s; the only thing here that is not the same in every run.
    pub seconds: f64,
}

/// Properties of the mechanism that parameters show.
#[derive(Debug, Clone, PartialEq)]
pub enum Mechanism {
    /// Of `gmr-play`.
    Plays(PlayMechanism),
    /// Of `gmr-stop`.
    Stops(StopMechanism),
}

impl fmt::Display for Mechanism {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plays(found) => found.fmt(f),
            Self::Stops(found) => found.fmt(f),
        }
    }
}

/// How models were found.
#[derive(Debug)]
pub struct FitReport {
    /// What was held out.
    pub split: Split,
    /// Properties of the recording alone.
    pub survey: Survey,
    /// Indices of the rows used for training.
    pub training: Vec<usize>,
    /// How far the outputs wander away from the model that was taken.
    pub drift: Drift,
    /// Numbers of components that were tried for `gmr`, in rising order; none where it was not
    /// fitted.
    pub candidates: Vec<Candidate>,
    /// Scores of the families that could be fitted, the simplest first; none where a family was
    /// asked for.
    pub scores: Vec<Score>,
}

impl FitOutcome {
    /// Why this family was taken: a sentence per family that was scored.
    #[must_use]
    pub fn reasons(&self) -> Vec<String> {
        let output = self.model.file().outputs.first();
        let unit = output.map_or(OutputUnit::Deg, |output| output.unit);
        let scores = self.report.scores.iter();
        scores.map(|score| score.sentence(unit)).collect()
    }
}

impl FitReport {
    /// The number of components that was taken for `gmr`.
    #[must_use]
    pub fn chosen(&self) -> Option<&Candidate> {
        let is_chosen = |candidate: &&Candidate| matches!(candidate.verdict, Verdict::Chosen);
        self.candidates.iter().find(is_chosen)
    }
}
