//! From a recording to a model: the whole of a calibration but reading and writing.

use i2ris::model::{Hull, MAX_COMPONENTS, Model, ModelError};
use i2ris::units::MotorVec;

use crate::em::{EmError, EmOptions, MixtureFit, fit_mixture, fit_mixtures};
use crate::family::{Family, Fitted, Frame};
use crate::linear::{LinearError, fit_linear};
use crate::progress::Progress;
use crate::recording::Recording;
use crate::spike::SpikeOptions;
use crate::split::{HoldOut, Split, SplitError};
use crate::survey::{Survey, inputs, outputs};
use crate::table::Table;

/// How to fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// The robot that was recorded.
    pub robot_id: String,
    /// What to fit.
    pub family: Family,
    /// Components of a mixture.
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
            family: Family::Gmr,
            components: Components::UpTo(12),
            em: EmOptions::default(),
            hold_out: HoldOut::default(),
            spikes: SpikeOptions::default(),
        }
    }
}

/// How many components a mixture has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Components {
    /// So many.
    Exactly(usize),
    /// From one to so many, or as many as the rows can carry: the number with the lowest BIC among those whose model
    /// can be inverted all over the hull.
    UpTo(usize),
}

/// A model, and how it came about.
#[derive(Debug)]
pub struct FitOutcome {
    /// Checked, prepared, and measured on the recording.
    pub model: Model,
    /// The affine model of the same rows, to compare with. It is the same model if the family is linear.
    pub linear: Model,
    /// The rest.
    pub report: FitReport,
}

/// How a model came about.
#[derive(Debug)]
pub struct FitReport {
    /// What was held out.
    pub split: Split,
    /// What the recording says by itself.
    pub survey: Survey,
    /// Indices of the rows used for training.
    pub training: Vec<usize>,
    /// Numbers of components that were tried, in rising order; none for families without a mixture.
    pub candidates: Vec<Candidate>,
}

impl FitReport {
    /// The number of components that was taken.
    #[must_use]
    pub fn chosen(&self) -> Option<&Candidate> {
        self.candidates.iter().find(|candidate| matches!(candidate.verdict, Verdict::Chosen))
    }
}

/// A number of components that was tried.
#[derive(Debug)]
pub struct Candidate {
    /// The number.
    pub components: usize,
    /// The mixture, unless no start succeeded.
    pub fit: Option<MixtureFit>,
    /// What became of it.
    pub verdict: Verdict,
}

/// What became of a candidate.
#[derive(Debug)]
pub enum Verdict {
    /// Taken.
    Chosen,
    /// Another has a lower BIC.
    Surpassed,
    /// Its BIC is lower than that of the one chosen, but its model was refused.
    Refused(ModelError),
    /// There is no mixture.
    Failed(EmError),
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
    #[error("output `{output}` does not change in the rows used for training; record motion of it, or hold out others")]
    Constant {
        /// Its name.
        output: String,
    },
    /// No mixture.
    #[error(transparent)]
    Mixture(#[from] EmError),
    /// The model is refused, as the controller would refuse it.
    #[error("the model of family `{family}` is refused: {source}")]
    Refused {
        /// The family.
        family: Family,
        /// Why.
        source: Box<ModelError>,
    },
}

/// Fits a model to a recording: looks for spikes, holds rows out, fits, checks as the controller checks, and measures.
///
/// # Errors
///
/// When the recording does not determine a model, or the model is refused; see [`FitError`].
pub fn fit(recording: &Recording, options: &FitOptions, progress: &dyn Progress) -> Result<FitOutcome, FitError> {
    let survey = Survey::new(recording, &options.spikes)?;
    let split = Split::new(recording, options.hold_out)?;
    let usable = |row: &usize| options.spikes.keep || !survey.is_flagged(*row);
    let training: Vec<usize> = split.training().filter(usable).collect();
    outputs_change(recording, &training)?;
    let (inputs, outputs) = (inputs(recording, training.iter().copied()), outputs(recording, training.iter().copied()));
    let linear = fit_linear(&inputs, &outputs)?;
    let hull = hull(&inputs).map_err(|source| refused(Family::Linear, source))?.parameters();
    let frame = Frame {
        recording,
        split: &split,
        training: &training,
        hull: &hull,
        robot_id: &options.robot_id,
        seed: options.em.seed,
        restarts: options.em.restarts,
    };
    let baseline = || frame.model(Fitted::Linear(&linear)).map_err(|source| refused(Family::Linear, source));
    let (model, candidates) = match options.family {
        Family::Linear => (baseline()?, Vec::new()),
        Family::Gmr => gmr(&frame, &joint(&inputs, &outputs), options, progress)?,
    };
    let linear = baseline()?;
    Ok(FitOutcome { model, linear, report: FitReport { split, survey, training, candidates } })
}

fn refused(family: Family, source: ModelError) -> FitError {
    FitError::Refused { family, source: Box::new(source) }
}

fn outputs_change(recording: &Recording, training: &[usize]) -> Result<(), FitError> {
    for (output, spec) in recording.outputs().iter().enumerate() {
        let mut values = training.iter().map(|row| recording.rows()[*row].outputs[output]);
        let first = values.next();
        if values.all(|value| Some(value) == first) {
            return Err(FitError::Constant { output: spec.name.clone() });
        }
    }
    Ok(())
}

fn hull(inputs: &Table) -> Result<Hull, ModelError> {
    let padded = |row: &[f64]| {
        let mut counts = MotorVec::default();
        counts.iter_mut().zip(row).for_each(|(count, value)| *count = *value);
        counts
    };
    Hull::from_points(inputs.width(), &inputs.rows().map(padded).collect::<Vec<_>>())
}

/// `[counts; outputs]`, the variables of the mixture.
fn joint(inputs: &Table, outputs: &Table) -> Table {
    let rows = inputs.rows().zip(outputs.rows());
    Table::from_rows(inputs.width() + outputs.width(), rows.map(|(x, y)| x.iter().chain(y).copied()))
}

fn gmr(
    frame: &Frame,
    data: &Table,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<(Model, Vec<Candidate>), FitError> {
    match options.components {
        Components::Exactly(components) => {
            let fit = fit_mixture(data, components, &options.em, progress)?;
            let model = frame.model(Fitted::Gmr(&fit)).map_err(|source| refused(Family::Gmr, source))?;
            Ok((model, vec![Candidate { components, fit: Some(fit), verdict: Verdict::Chosen }]))
        }
        Components::UpTo(most) => {
            let range = 1..=most.clamp(1, MAX_COMPONENTS);
            let fits = fit_mixtures(data, range.clone(), &options.em, progress)?;
            choose(frame, range.zip(fits).map(|(components, fit)| candidate(components, fit)).collect())
        }
    }
}

fn candidate(components: usize, fit: Result<MixtureFit, EmError>) -> Candidate {
    match fit {
        Ok(fit) => Candidate { components, fit: Some(fit), verdict: Verdict::Surpassed },
        Err(error) => Candidate { components, fit: None, verdict: Verdict::Failed(error) },
    }
}

/// Takes the candidate with the lowest BIC whose model passes.
fn choose(frame: &Frame, mut candidates: Vec<Candidate>) -> Result<(Model, Vec<Candidate>), FitError> {
    let bic = |candidate: &Candidate| candidate.fit.as_ref().map_or(f64::INFINITY, |fit| fit.bic);
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|a, b| bic(&candidates[*a]).total_cmp(&bic(&candidates[*b])));
    for index in order {
        let candidate = &mut candidates[index];
        let Some(fit) = &candidate.fit else { continue };
        match frame.model(Fitted::Gmr(fit)) {
            Ok(model) => {
                candidate.verdict = Verdict::Chosen;
                return Ok((model, candidates));
            }
            Err(error) => candidate.verdict = Verdict::Refused(error),
        }
    }
    Err(simplest_reason(candidates))
}

/// Why none of the candidates could be taken: the reason of the simplest one, which had the best chance.
fn simplest_reason(candidates: Vec<Candidate>) -> FitError {
    let reason = |candidate: Candidate| match candidate.verdict {
        Verdict::Refused(error) => Some(refused(Family::Gmr, error)),
        Verdict::Failed(error) => Some(FitError::Mixture(error)),
        Verdict::Chosen | Verdict::Surpassed => None,
    };
    let nothing = EmError::NoStartSucceeded { components: 1, failures: Vec::new() };
    candidates.into_iter().find_map(reason).unwrap_or(FitError::Mixture(nothing))
}

#[cfg(test)]
mod tests;
