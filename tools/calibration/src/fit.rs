//! From a recording to models: the whole of a calibration but reading and writing.

mod gmr;
mod work;

use std::error::Error;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use i2ris::model::{Hull, Model, ModelError};
use i2ris::units::MotorVec;

pub use gmr::{Candidate, Verdict};
use work::Work;

use crate::drift::Drift;
use crate::em::{EmError, EmOptions};
use crate::family::{Family, Frame, ParseFamilyError};
use crate::identify::Finding;
use crate::linear::{LinearError, fit_linear};
use crate::play;
use crate::progress::Progress;
use crate::recording::Recording;
use crate::series::Series;
use crate::slope::FlatSpot;
use crate::spike::SpikeOptions;
use crate::split::{HoldOut, Split, SplitError};
use crate::stop::StopReading;
use crate::survey::{Survey, inputs, outputs};
use crate::table::Table;

/// How to fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// The robot that was recorded.
    pub robot_id: String,
    /// What to fit.
    pub choice: Choice,
    /// Components of a mixture on the counts.
    pub components: Components,
    /// How to fit a mixture.
    pub em: EmOptions,
    /// What to hold out.
    pub hold_out: HoldOut,
    /// What to take for a spike.
    pub spikes: SpikeOptions,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            robot_id: "i2ris".to_owned(),
            choice: Choice::Best,
            components: Components::UpTo(MAX_COMPONENTS_TRIED),
            em: EmOptions::default(),
            hold_out: HoldOut::default(),
            spikes: SpikeOptions::default(),
        }
    }
}

/// Components of a mixture on the counts that are tried.
const MAX_COMPONENTS_TRIED: usize = 12;

/// Which families are fitted, and which of them is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// All of them; the one with the least error on the rows held out.
    Best,
    /// One of them, and `linear` to compare with.
    One(Family),
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Best => f.write_str("best"),
            Self::One(family) => family.fmt(f),
        }
    }
}

impl FromStr for Choice {
    type Err = ParseFamilyError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "best" {
            Ok(Self::Best)
        } else {
            text.parse().map(Self::One)
        }
    }
}

/// How many components a mixture on the counts has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Components {
    /// So many.
    Exactly(usize),
    /// From one to so many, or as many as the rows can carry: the least number that comes near the
    /// least error on blocks left out, among those whose model can be inverted all over the hull.
    UpTo(usize),
}

/// Models, and how they came about.
#[derive(Debug)]
pub struct FitOutcome {
    /// The model that was taken: checked, prepared, and measured on the recording.
    pub model: Arc<Model>,
    /// Its family.
    pub family: Family,
    /// The affine model of the same rows, to compare with. It is the same model if `family` is
    /// linear.
    pub linear: Arc<Model>,
    /// What became of every family that was to be fitted, the simplest first.
    pub families: Vec<FamilyOutcome>,
    /// The rest.
    pub report: FitReport,
}

/// What became of a family.
#[derive(Debug)]
pub struct FamilyOutcome {
    /// Which.
    pub family: Family,
    /// The model, or why there is none.
    pub result: Result<Arc<Model>, FitError>,
    /// What its parameters say about the robot, of families that say anything.
    pub reading: Option<Reading>,
    /// How long it took, s; the only thing here that is not the same in every run.
    pub seconds: f64,
}

/// What parameters say about the robot.
#[derive(Debug, Clone, PartialEq)]
pub enum Reading {
    /// Of `gmr-play`.
    Plays(play::reading::Reading),
    /// Of `gmr-stop`.
    Stops(StopReading),
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plays(reading) => reading.fmt(f),
            Self::Stops(reading) => reading.fmt(f),
        }
    }
}

/// How models came about.
#[derive(Debug)]
pub struct FitReport {
    /// What was held out.
    pub split: Split,
    /// What the recording says by itself.
    pub survey: Survey,
    /// Indices of the rows used for training.
    pub training: Vec<usize>,
    /// How far the outputs wander away from the model that was taken.
    pub drift: Drift,
    /// Numbers of components that were tried for `gmr`, in rising order; none where it was not
    /// fitted.
    pub candidates: Vec<Candidate>,
}

impl FitReport {
    /// The number of components that was taken for `gmr`.
    #[must_use]
    pub fn chosen(&self) -> Option<&Candidate> {
        self.candidates
            .iter()
            .find(|candidate| matches!(candidate.verdict, Verdict::Chosen))
    }
}

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// Too much is held out.
    #[error(transparent)]
    Split(#[from] SplitError),
    /// The motors do not span their space.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// An output that says nothing.
    #[error(
        "output `{output}` does not change in the rows used for training; record motion of it, or hold out others"
    )]
    Constant {
        /// Its name.
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
        /// Why.
        source: Box<dyn Error + Send + Sync>,
    },
    /// Every mixture is flat somewhere.
    #[error(
        "the mixture of {components} component(s) is refused: {spot}; record more of that region"
    )]
    TooFlat {
        /// How many.
        components: usize,
        /// Where.
        spot: FlatSpot,
    },
    /// The recording cannot tell what the family would have to remember.
    #[error("{0}")]
    NoHysteresis(Finding),
    /// Nothing is held out to choose by.
    #[error(
        "choosing the best family takes rows held out; name a family with --family, or hold something out"
    )]
    NothingToChooseBy,
    /// The model is refused, as the controller would refuse it.
    #[error("the model of family `{family}` is refused: {source}")]
    Refused {
        /// The family.
        family: Family,
        /// Why.
        source: Box<ModelError>,
    },
}

/// Fits models to a recording: looks for spikes, holds rows out, fits, checks as the controller
/// checks, and measures.
///
/// # Errors
///
/// When the recording does not determine a model, or the model that was asked for is refused; see
/// [`FitError`]. With [`Choice::Best`], families that fail are told in the outcome.
pub fn fit(
    recording: &Recording,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<FitOutcome, FitError> {
    let survey = Survey::new(recording, &options.spikes)?;
    let split = Split::new(recording, options.hold_out)?;
    if options.choice == Choice::Best && split.held_out().is_empty() {
        return Err(FitError::NothingToChooseBy);
    }
    let usable = |row: &usize| options.spikes.keep || !survey.is_flagged(*row);
    let training: Vec<usize> = split.training().filter(usable).collect();
    outputs_change(recording, &training)?;
    let (inputs, outputs) = (
        inputs(recording, training.iter().copied()),
        outputs(recording, training.iter().copied()),
    );
    let straight = fit_linear(&inputs, &outputs)?;
    let hull = hull(&inputs)
        .map_err(|source| refused(Family::Linear, source))?
        .parameters();
    let frame = Frame {
        recording,
        split: &split,
        training: &training,
        hull: &hull,
        robot_id: &options.robot_id,
        seed: options.em.seed,
    };
    let series = Series::new(recording, &training);
    let hidden = survey.hides_hysteresis();
    let mut work = Work {
        frame,
        series,
        hidden,
        inputs,
        outputs,
        straight,
        options,
        progress,
        candidates: Vec::new(),
    };
    let wanted: Vec<Family> = Family::ALL
        .into_iter()
        .filter(|family| options.choice.wants(*family))
        .collect();
    let mut families: Vec<FamilyOutcome> = wanted
        .into_iter()
        .map(|family| work.attempt(family))
        .collect();
    let candidates = work.candidates;
    let (linear, family, model) = choose(&mut families, options.choice)?;
    let drift = Drift::new(&model, recording, |row| usable(&row));
    Ok(FitOutcome {
        model,
        family,
        linear,
        families,
        report: FitReport {
            split,
            survey,
            training,
            drift,
            candidates,
        },
    })
}

impl Choice {
    fn wants(self, family: Family) -> bool {
        match self {
            Self::Best => true,
            Self::One(one) => family == Family::Linear || family == one,
        }
    }
}

/// The affine model, and the family and model to take. An error where there is none.
fn choose(
    families: &mut Vec<FamilyOutcome>,
    choice: Choice,
) -> Result<(Arc<Model>, Family, Arc<Model>), FitError> {
    let model =
        |outcome: &FamilyOutcome| Some((outcome.family, outcome.result.as_ref().ok()?.clone()));
    let wanted =
        |outcome: &&FamilyOutcome| choice == Choice::Best || choice == Choice::One(outcome.family);
    let linear = families
        .iter()
        .find(|outcome| outcome.family == Family::Linear)
        .and_then(model);
    let models = families.iter().filter(wanted).filter_map(model);
    let best = models.min_by(|a, b| held_out_error(&a.1).total_cmp(&held_out_error(&b.1)));
    match (linear, best) {
        (Some((_, linear)), Some((family, model))) => Ok((linear, family, model)),
        _ => {
            let failed = families
                .iter()
                .position(|outcome| outcome.result.is_err())
                .unwrap_or_default();
            let reason = families.swap_remove(failed).result.err();
            Err(reason.unwrap_or(FitError::NothingToChooseBy))
        }
    }
}

/// Mean square over the held-out rows of the length of the error, in the unit of the outputs.
fn held_out_error(model: &Model) -> f64 {
    let squares = model
        .file()
        .metrics
        .iter()
        .map(|metrics| metrics.held_out.map_or(0.0, |fit| fit.rmsd * fit.rmsd));
    squares.sum()
}

fn refused(family: Family, source: ModelError) -> FitError {
    FitError::Refused {
        family,
        source: Box::new(source),
    }
}

fn outputs_change(recording: &Recording, training: &[usize]) -> Result<(), FitError> {
    for (output, spec) in recording.outputs().iter().enumerate() {
        let mut values = training
            .iter()
            .map(|row| recording.rows()[*row].outputs[output]);
        let first = values.next();
        if values.all(|value| Some(value) == first) {
            return Err(FitError::Constant {
                output: spec.name.clone(),
            });
        }
    }
    Ok(())
}

fn hull(inputs: &Table) -> Result<Hull, ModelError> {
    let padded = |row: &[f64]| {
        let mut counts = MotorVec::default();
        counts
            .iter_mut()
            .zip(row)
            .for_each(|(count, value)| *count = *value);
        counts
    };
    Hull::from_points(
        inputs.width(),
        &inputs.rows().map(padded).collect::<Vec<_>>(),
    )
}

#[cfg(test)]
mod tests;
