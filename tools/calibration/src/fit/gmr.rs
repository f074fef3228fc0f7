//! The number of components of a mixture on the counts.

use i2ris::model::file::FamilyParameters;
use i2ris::model::{MAX_COMPONENTS, Model, ModelError};

use super::error::{FitError, refused};
use super::family::Family;
use super::flatness::{FlatSpot, flat_spot};
use super::model_file::{FileContext, Fitted};
use super::options::{Components, FitOptions};
use crate::em::error::EmError;
use crate::em::mixture::MixtureFit;
use crate::em::restarts::{fit_mixture, fit_mixtures};
use crate::progress::Progress;
use crate::regression::component_choice::{first_near_least, left_out_errors};
use crate::regression::linear::LinearFit;
use crate::table::DataTable;

/// A number of components that was tried.
#[derive(Debug)]
pub struct Candidate {
    /// The number.
    pub components: usize,
    /// The mixture, unless no start succeeded.
    pub fit: Option<MixtureFit>,
    /// RMS length of the error on blocks left out one at a time, in the unit of the outputs; `None`
    /// where a block could not be predicted, or the number was given.
    pub left_out_rms: Option<f64>,
    /// Whether it was taken, and why not.
    pub verdict: Verdict,
}

/// Whether a candidate was taken, and why not.
#[derive(Debug)]
pub enum Verdict {
    /// Taken.
    Chosen,
    /// Another does as well with fewer components, or better.
    Surpassed,
    /// It would have been taken, but its model was refused.
    Refused(ModelError),
    /// It would have been taken, but its model is flat where the recording does not show that the
    /// robot is.
    TooFlat(FlatSpot),
    /// There is no mixture.
    Failed(EmError),
}

/// The data of a mixture on the counts.
#[derive(Clone, Copy)]
pub(super) struct GmrData<'a> {
    pub inputs: &'a DataTable,
    pub outputs: &'a DataTable,
    /// The affine model of the same rows.
    pub straight: &'a LinearFit,
}

/// A mixture on the counts and its candidates.
pub(super) fn fit(
    context: &FileContext,
    data: GmrData,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<(Model, Vec<Candidate>), FitError> {
    let joint = &joint(data.inputs, data.outputs);
    match options.components {
        Components::Exactly(components) => {
            let fit = fit_mixture(joint, components, &options.em, progress)?;
            let model = context
                .model(&fitted(&fit, options))
                .map_err(|source| refused(Family::Gmr, source))?;
            let candidate = Candidate {
                components,
                fit: Some(fit),
                left_out_rms: None,
                verdict: Verdict::Chosen,
            };
            Ok((model, vec![candidate]))
        }
        Components::UpTo(most) => {
            let range = 1..=most.clamp(1, MAX_COMPONENTS);
            let fits = fit_mixtures(joint, range.clone(), &options.em, progress)?;
            let tried: Vec<usize> = range.take(fits.len()).collect();
            let errors = left_out_errors(joint, data.inputs.width(), &tried, &options.em, progress);
            let candidates = tried.into_iter().zip(fits).zip(errors);
            let candidates = candidates.map(|((k, fit), error)| candidate(k, fit, error));
            choose(context, data, candidates.collect(), options)
        }
    }
}

fn fitted(fit: &MixtureFit, options: &FitOptions) -> Fitted {
    Fitted {
        family: FamilyParameters::Gmr { mixture: fit.parameters.clone() },
        log_likelihood: Some(fit.log_likelihood),
        bic: Some(fit.bic),
        restarts: options.em.restarts,
    }
}

fn candidate(components: usize, fit: Result<MixtureFit, EmError>, error: f64) -> Candidate {
    let left_out_rms = error.is_finite().then(|| error.sqrt());
    let (fit, verdict) = match fit {
        Ok(fit) => (Some(fit), Verdict::Surpassed),
        Err(error) => (None, Verdict::Failed(error)),
    };
    Candidate { components, fit, left_out_rms, verdict }
}

/// Takes the simplest candidate that does about as well as the best, of those whose model passes.
fn choose(
    context: &FileContext,
    data: GmrData,
    mut candidates: Vec<Candidate>,
    options: &FitOptions,
) -> Result<(Model, Vec<Candidate>), FitError> {
    loop {
        let error = |candidate: &Candidate| match (&candidate.verdict, candidate.left_out_rms) {
            (Verdict::Surpassed, Some(rms)) => rms * rms,
            _ => f64::INFINITY,
        };
        let errors: Vec<f64> = candidates.iter().map(error).collect();
        let best = first_near_least(&errors).map(|index| &mut candidates[index]);
        let Some(Candidate { fit: Some(fit), verdict, .. }) = best else {
            return Err(simplest_reason(candidates));
        };
        match context.model(&fitted(fit, options)) {
            Ok(model) => match flat_spot(&model, data.inputs, data.outputs, data.straight) {
                Some(spot) => *verdict = Verdict::TooFlat(spot),
                None => {
                    *verdict = Verdict::Chosen;
                    return Ok((model, candidates));
                }
            },
            Err(error) => *verdict = Verdict::Refused(error),
        }
    }
}

/// `[counts; outputs]`, the variables of the mixture.
fn joint(inputs: &DataTable, outputs: &DataTable) -> DataTable {
    let rows = inputs.rows().zip(outputs.rows());
    DataTable::from_rows(
        inputs.width() + outputs.width(),
        rows.map(|(x, y)| x.iter().chain(y).copied()),
    )
}

/// Why none of the candidates could be taken: the reason of the simplest one, which had the best
/// chance.
fn simplest_reason(candidates: Vec<Candidate>) -> FitError {
    let reason = |candidate: Candidate| match candidate.verdict {
        Verdict::Refused(error) => Some(refused(Family::Gmr, error)),
        Verdict::Failed(error) => Some(FitError::Mixture(error)),
        Verdict::TooFlat(spot) => {
            Some(FitError::TooFlat { components: candidate.components, spot })
        }
        Verdict::Chosen | Verdict::Surpassed => None,
    };
    let nothing = EmError::NoStartSucceeded { components: 1, failures: Vec::new() };
    let reason = candidates.into_iter().find_map(reason);
    reason.unwrap_or(FitError::Mixture(nothing))
}
