//! The number of components of a mixture on the counts.

use i2ris::model::file::FamilyParameters;
use i2ris::model::{MAX_COMPONENTS, Model, ModelError};

use super::{Components, FitError, FitOptions, refused};
use crate::components::{least_that_comes_near, left_out_errors};
use crate::em::{EmError, MixtureFit, fit_mixture, fit_mixtures};
use crate::family::{Family, Fitted, Frame};
use crate::linear::LinearFit;
use crate::progress::Progress;
use crate::slope::{FlatSpot, flat_spot};
use crate::table::Table;

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
    /// What became of it.
    pub verdict: Verdict,
}

/// What became of a candidate.
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

/// What a mixture on the counts is fitted to.
#[derive(Clone, Copy)]
pub(super) struct Data<'a> {
    pub inputs: &'a Table,
    pub outputs: &'a Table,
    /// The affine model of the same rows.
    pub straight: &'a LinearFit,
}

/// A mixture on the counts and its candidates.
pub(super) fn fit(
    frame: &Frame,
    data: Data,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<(Model, Vec<Candidate>), FitError> {
    let joint = &joint(data.inputs, data.outputs);
    match options.components {
        Components::Exactly(components) => {
            let fit = fit_mixture(joint, components, &options.em, progress)?;
            let model = frame
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
            let outputs = frame.recording.outputs().len();
            let errors = match frame.recording.motors() {
                1 => left_out_errors::<1>(joint, outputs, &tried, &options.em, progress),
                _ => left_out_errors::<2>(joint, outputs, &tried, &options.em, progress),
            };
            let candidates = tried.into_iter().zip(fits).zip(&errors);
            choose(
                frame,
                data,
                candidates
                    .map(|((k, fit), error)| candidate(k, fit, *error))
                    .collect(),
                options,
            )
        }
    }
}

fn fitted(fit: &MixtureFit, options: &FitOptions) -> Fitted {
    Fitted {
        family: FamilyParameters::Gmr {
            mixture: fit.parameters.clone(),
        },
        log_likelihood: Some(fit.log_likelihood),
        bic: Some(fit.bic),
        restarts: options.em.restarts,
    }
}

fn candidate(components: usize, fit: Result<MixtureFit, EmError>, error: f64) -> Candidate {
    let left_out_rms = error.is_finite().then(|| error.sqrt());
    match fit {
        Ok(fit) => Candidate {
            components,
            fit: Some(fit),
            left_out_rms,
            verdict: Verdict::Surpassed,
        },
        Err(error) => Candidate {
            components,
            fit: None,
            left_out_rms,
            verdict: Verdict::Failed(error),
        },
    }
}

/// Takes the simplest candidate that does about as well as the best, of those whose model passes.
fn choose(
    frame: &Frame,
    data: Data,
    mut candidates: Vec<Candidate>,
    options: &FitOptions,
) -> Result<(Model, Vec<Candidate>), FitError> {
    loop {
        let open = |candidate: &Candidate| matches!(candidate.verdict, Verdict::Surpassed);
        let errors: Vec<f64> = candidates
            .iter()
            .map(|candidate| {
                candidate
                    .left_out_rms
                    .filter(|_| open(candidate))
                    .map_or(f64::INFINITY, |rms| rms * rms)
            })
            .collect();
        let Some(candidate) =
            least_that_comes_near(&errors).and_then(|index| candidates.get_mut(index))
        else {
            return Err(simplest_reason(candidates));
        };
        let Some(fit) = &candidate.fit else {
            return Err(simplest_reason(candidates));
        };
        match frame.model(&fitted(fit, options)) {
            Ok(model) => match flat_spot(&model, data.inputs, data.outputs, data.straight) {
                Some(spot) => candidate.verdict = Verdict::TooFlat(spot),
                None => {
                    candidate.verdict = Verdict::Chosen;
                    return Ok((model, candidates));
                }
            },
            Err(error) => candidate.verdict = Verdict::Refused(error),
        }
    }
}

/// `[counts; outputs]`, the variables of the mixture.
fn joint(inputs: &Table, outputs: &Table) -> Table {
    let rows = inputs.rows().zip(outputs.rows());
    Table::from_rows(
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
        Verdict::TooFlat(spot) => Some(FitError::TooFlat {
            components: candidate.components,
            spot,
        }),
        Verdict::Chosen | Verdict::Surpassed => None,
    };
    let nothing = EmError::NoStartSucceeded {
        components: 1,
        failures: Vec::new(),
    };
    candidates
        .into_iter()
        .find_map(reason)
        .unwrap_or(FitError::Mixture(nothing))
}
