//! A mixture on the counts, and its number of components.

use i2ris::model::file::FamilyParameters;
use i2ris::model::{MAX_COMPONENTS, Model};

use super::error::{FitError, refused};
use super::family::Family;
use super::flatness::flat_spot;
use super::model_file::{FileContext, Fitted};
use super::options::{Components, FitOptions};
use crate::em::error::EmError;
use crate::em::mixture::{MixtureFit, most_components};
use crate::em::restarts::fit_mixture;
use crate::progress::Progress;
use crate::regression::component_choice::{first_near_least, left_out_errors};
use crate::regression::linear::LinearFit;
use crate::table::DataTable;

/// The data of a mixture on the counts.
#[derive(Clone, Copy)]
pub(super) struct GmrData<'a> {
    pub inputs: &'a DataTable,
    pub outputs: &'a DataTable,
    /// The affine model of the same rows.
    pub straight: &'a LinearFit,
}

/// A mixture on the counts: of the numbers of components, the simplest that does about as well on
/// blocks left out as the best, of those whose model passes.
pub(super) fn fit(
    context: &FileContext,
    data: GmrData,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<Model, FitError> {
    let joint = &joint(data.inputs, data.outputs);
    let model = |components: usize| {
        let fit = fit_mixture(joint, components, &options.em, progress)?;
        context.model(&fitted(fit, options)).map_err(|source| refused(Family::Gmr, source))
    };
    let most = match options.components {
        Components::Exactly(components) => return model(components),
        Components::UpTo(most) => most.clamp(1, MAX_COMPONENTS),
    };
    let checked = |components: usize| {
        let model = model(components)?;
        match flat_spot(&model, data.inputs, data.outputs, data.straight) {
            Some(spot) => Err(FitError::TooFlat { components, spot }),
            None => Ok(model),
        }
    };
    let most = most.min(most_components(joint.len(), joint.width())).max(1);
    let tried: Vec<usize> = (1..=most).collect();
    let mut errors = left_out_errors(joint, data.inputs.width(), &tried, &options.em, progress);
    // Why none can be taken: the reason of the simplest one, which had the best chance.
    let mut reasons: Vec<Option<FitError>> = tried.iter().map(|_| None).collect();
    while let Some(best) = first_near_least(&errors) {
        match checked(tried[best]) {
            Ok(model) => return Ok(model),
            Err(error) => (errors[best], reasons[best]) = (f64::INFINITY, Some(error)),
        }
    }
    let nothing = EmError::NoStartSucceeded { components: 1, failures: Vec::new() };
    Err(reasons.into_iter().flatten().next().unwrap_or(FitError::Mixture(nothing)))
}

fn fitted(fit: MixtureFit, options: &FitOptions) -> Fitted {
    Fitted {
        family: FamilyParameters::Gmr { mixture: fit.parameters },
        log_likelihood: Some(fit.log_likelihood),
        bic: Some(fit.bic),
        restarts: options.em.restarts,
    }
}

/// `[counts; outputs]`, the variables of the mixture.
pub(super) fn joint(inputs: &DataTable, outputs: &DataTable) -> DataTable {
    let rows = inputs.rows().zip(outputs.rows());
    DataTable::from_rows(
        inputs.width() + outputs.width(),
        rows.map(|(x, y)| x.iter().chain(y).copied()),
    )
}
