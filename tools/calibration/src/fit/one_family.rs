//! The fit of each family, from the same rows.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use i2ris::model::file::{FamilyParameters, OutputMetrics};
use i2ris::model::{Model, ModelError};

use super::error::{FitError, refused};
use super::family::{Choice, Family};
use super::flatness::flat_spot;
use super::gmr::{self, GmrData};
use super::model_file::{FileContext, Fitted};
use super::options::{Components, FitOptions};
use super::outcome::{FamilyOutcome, Mechanism};
use crate::families::chain::ChainOptions;
use crate::families::force_balance::search::fit_force_balance;
use crate::families::play::play_fit::fit_play;
use crate::progress::Progress;
use crate::quality::Finding;
use crate::regression::component_choice::fewer;
use crate::regression::linear::LinearFit;
use crate::series::Series;
use crate::table::DataTable;

/// The error of a family may be so many times that of a straight line, or anything below this part
/// of the range of the outputs: of a straight snake all families are good.
const MOST_ERROR: f64 = 1.05;
const LEAST_NRMSD: f64 = 0.01;

/// Why the parameters of a family cannot be found.
type Reason = Box<dyn Error + Send + Sync>;

/// The data of all families.
pub(super) struct FamilyFitter<'a> {
    pub context: FileContext<'a>,
    pub series: Series,
    /// Why the recording cannot show hysteresis, if it cannot.
    pub hidden: Option<Finding>,
    /// Why the recording shows nothing between the axes of the motors, if it does not.
    pub one_axis: Option<Finding>,
    pub inputs: &'a DataTable,
    pub outputs: &'a DataTable,
    pub straight: &'a LinearFit,
    pub options: &'a FitOptions,
    /// Parameters of the same family from most of the same rows: what was chosen there stays.
    pub known: Option<&'a FamilyParameters>,
    pub progress: &'a dyn Progress,
}

impl FamilyFitter<'_> {
    /// Fits a family and measures the time.
    pub fn attempt(&self, family: Family) -> FamilyOutcome {
        let begin = Instant::now();
        let mut mechanism = None;
        let result = self.fit(family, &mut mechanism);
        let result = result.and_then(|model| self.not_worse_than_linear(family, model));
        let result = result.map(Arc::new);
        FamilyOutcome { family, result, mechanism, seconds: begin.elapsed().as_secs_f64() }
    }

    fn fit(&self, family: Family, mechanism: &mut Option<Mechanism>) -> Result<Model, FitError> {
        if family.has_memory()
            && let Some(reason) = self.hidden
        {
            return Err(FitError::NoHysteresis(reason));
        }
        if let Some(reason) = self.one_axis
            && self.options.choice == Choice::Best
            && !family.is_separable()
        {
            return Err(FitError::OneAxisAtATime(reason));
        }
        match family {
            Family::Linear => self.checked(family, &Fitted::from(self.straight)),
            Family::Gmr => self.gmr(),
            Family::GmrPlay => self.play(mechanism),
            Family::ForceBalance => self.force_balance(mechanism),
        }
    }

    /// What learns from the rows has to explain them better than a straight line.
    fn not_worse_than_linear(&self, family: Family, model: Model) -> Result<Model, FitError> {
        let square = |metrics: &OutputMetrics| metrics.training.rmsd.powi(2);
        let rms = model.file().metrics.iter().map(square).sum::<f64>().sqrt();
        let covariance = self.straight.covariance.iter().enumerate();
        let linear_rms = covariance.map(|(output, row)| row[output]).sum::<f64>().sqrt();
        let mut metrics = model.file().metrics.iter();
        let is_visible = metrics.any(|metrics| metrics.training.nrmsd > LEAST_NRMSD);
        if family != Family::Linear && is_visible && rms > MOST_ERROR * linear_rms {
            return Err(FitError::WorseThanLinear { rms, linear_rms });
        }
        Ok(model)
    }

    fn checked(&self, family: Family, fitted: &Fitted) -> Result<Model, FitError> {
        self.context.model(fitted).map_err(|source| refused(family, source))
    }

    /// Fits with as many components as do best, and with fewer for as long as the model has no
    /// inverse: the more there are, the more easily the regression folds where the recording has
    /// few rows.
    fn with_inverse(
        &self,
        family: Family,
        fit: &dyn Fn(Option<usize>) -> Result<MixtureModel, Reason>,
    ) -> Result<Model, FitError> {
        let mut components = self.known_components();
        loop {
            let candidate =
                fit(components).map_err(|source| FitError::Family { family, source })?;
            match self.context.model(&candidate.fitted) {
                Err(
                    ModelError::NotInvertible { .. }
                    | ModelError::Gain { .. }
                    | ModelError::Rehearsal { .. },
                ) if candidate.components > 1 => {
                    components = fewer(candidate.components);
                }
                checked => return checked.map_err(|source| refused(family, source)),
            }
        }
    }

    /// The number of components of the mixture of [`Self::known`].
    fn known_components(&self) -> Option<usize> {
        match self.known? {
            FamilyParameters::Gmr { mixture } | FamilyParameters::GmrPlay { mixture, .. } => {
                Some(mixture.weights.len())
            }
            _ => None,
        }
    }

    fn gmr(&self) -> Result<Model, FitError> {
        let data = GmrData { inputs: self.inputs, outputs: self.outputs, straight: self.straight };
        let components = match self.known_components() {
            Some(components) => Components::Exactly(components),
            None => self.options.components,
        };
        let options = FitOptions { components, ..self.options.clone() };
        let model = gmr::fit(&self.context, data, &options, self.progress)?;
        if self.known.is_some()
            && let Some(spot) = flat_spot(&model, self.inputs, self.outputs, self.straight)
        {
            let components = self.known_components().unwrap_or_default();
            return Err(FitError::TooFlat { components, spot });
        }
        Ok(model)
    }

    fn play(&self, mechanism: &mut Option<Mechanism>) -> Result<Model, FitError> {
        let family = Family::GmrPlay;
        let first = fit_play(&self.series, &self.chain(self.known_components()), self.progress);
        let first = first.map_err(|source| failed(family, source))?;
        *mechanism = Some(Mechanism::Plays(first.mechanism.clone()));
        self.with_inverse(family, &|components| {
            let fit = match components {
                same if same == self.known_components() => first.clone(),
                fewer => first.refit(&self.series, &self.chain(fewer), self.progress)?,
            };
            let quality = (fit.chain.log_likelihood, fit.chain.bic);
            Ok(self.mixture_model(fit.family(), fit.chain.mixture.weights.len(), quality))
        })
    }

    fn force_balance(&self, mechanism: &mut Option<Mechanism>) -> Result<Model, FitError> {
        let known = match self.known {
            Some(FamilyParameters::ForceBalance { balance, .. }) => Some(balance),
            _ => None,
        };
        let fit = fit_force_balance(&self.series, self.one_axis.is_none(), known, self.progress);
        let fit = fit.map_err(|source| failed(Family::ForceBalance, source))?;
        *mechanism = Some(Mechanism::Balance(fit.mechanism));
        let checked = |parameters| self.checked(Family::ForceBalance, &Fitted::plain(parameters));
        checked(fit.family).or_else(|refused| {
            fit.simpler.into_iter().find_map(|simpler| checked(simpler).ok()).ok_or(refused)
        })
    }

    fn chain(&self, components: Option<usize>) -> ChainOptions {
        ChainOptions { components, em: self.options.em.clone(), ..ChainOptions::default() }
    }

    fn mixture_model(
        &self,
        family: FamilyParameters,
        components: usize,
        (log_likelihood, bic): (f64, f64),
    ) -> MixtureModel {
        let fitted = Fitted {
            family,
            log_likelihood: Some(log_likelihood),
            bic: Some(bic),
            restarts: self.options.em.restarts,
        };
        MixtureModel { fitted, components }
    }
}

/// A family with a mixture of so many components.
struct MixtureModel {
    fitted: Fitted,
    components: usize,
}

fn failed(family: Family, source: impl Error + Send + Sync + 'static) -> FitError {
    FitError::Family { family, source: Box::new(source) }
}
