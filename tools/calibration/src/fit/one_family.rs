//! The fit of each family, from the same rows.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use i2ris::model::Model;
use i2ris::model::file::{FamilyParameters, Mixture, OutputMetrics};

use super::flatness::flat_spot;
use super::model_file::{FileContext, Fitted};
use super::options::{Components, Family, FitOptions};
use super::outcome::{FamilyOutcome, FitError, MIN_NRMSD, Mechanism, noted_also, refused};
use crate::em::EmError;
use crate::families::chain::ChainOptions;
use crate::families::force_balance::search::{Start, fit_force_balance};
use crate::families::play::play_fit::{PlayFit, fit_play};
use crate::progress::Progress;
use crate::quality::Finding;
use crate::regression::component_choice::choose_components;
use crate::regression::linear::LinearFit;
use crate::regression::mixture::{RegressionData, SMOOTHING};
use crate::series::Series;
use crate::table::DataTable;

/// Maximum error of a family relative to that of a straight line, where it is not small.
const MAX_ERROR_RATIO: f64 = 1.05;

/// Minimum number of components of the published mixtures.
const PUBLISHED: usize = 3;

#[derive(Default)]
struct Remarks {
    mechanism: Option<Mechanism>,
    note: Option<String>,
    left_out: Vec<f64>,
}

pub(super) struct FamilyFitter<'a> {
    pub context: FileContext<'a>,
    pub series: Series,
    /// Why the recording cannot show hysteresis, if so.
    pub hidden: Option<Finding>,
    /// Why the recording lacks motion between the axes of the motors, if so.
    pub no_plane: Option<Finding>,
    pub inputs: &'a DataTable,
    pub outputs: &'a DataTable,
    pub straight: &'a LinearFit,
    pub options: &'a FitOptions,
    /// Parameters of the same family from most of the same rows, whose choices are kept.
    pub known: Option<&'a FamilyParameters>,
    pub start: Start<'a>,
    pub progress: &'a dyn Progress,
}

impl FamilyFitter<'_> {
    pub fn attempt(&self, family: Family) -> FamilyOutcome {
        let begin = Instant::now();
        let mut remarks = Remarks::default();
        let result = self.fit(family, &mut remarks);
        let result = result.and_then(|model| self.not_worse_than_linear(family, model));
        let result = result.map(Arc::new);
        let Remarks { mechanism, note, left_out } = remarks;
        let seconds = begin.elapsed().as_secs_f64();
        FamilyOutcome { family, result, mechanism, note, left_out, seconds }
    }

    fn fit(&self, family: Family, remarks: &mut Remarks) -> Result<Model, FitError> {
        if family.has_memory()
            && let Some(reason) = self.hidden
        {
            return Err(FitError::NoHysteresis(reason));
        }
        match family {
            Family::Linear => {
                let LinearFit { gain, offset, covariance } = self.straight.clone();
                let linear = FamilyParameters::Linear { gain, offset, covariance };
                self.checked(family, &Fitted::plain(linear))
            }
            Family::Gmr => self.gmr(remarks),
            Family::GmrPlay => self.play(remarks),
            Family::ForceBalance => self.force_balance(remarks),
        }
    }

    /// A fitted family must explain the rows better than a straight line.
    fn not_worse_than_linear(&self, family: Family, model: Model) -> Result<Model, FitError> {
        let square = |metrics: &OutputMetrics| metrics.training.rmsd.powi(2);
        let rms = model.file().metrics.iter().map(square).sum::<f64>().sqrt();
        let covariance = self.straight.covariance.iter().enumerate();
        let linear_rms = covariance.map(|(output, row)| row[output]).sum::<f64>().sqrt();
        let mut metrics = model.file().metrics.iter();
        let is_visible = metrics.any(|metrics| metrics.training.nrmsd > MIN_NRMSD);
        if family != Family::Linear && is_visible && rms > MAX_ERROR_RATIO * linear_rms {
            return Err(FitError::WorseThanLinear { rms, linear_rms });
        }
        Ok(model)
    }

    fn checked(&self, family: Family, fitted: &Fitted) -> Result<Model, FitError> {
        self.context.model(fitted).map_err(|source| refused(family, source))
    }

    /// Smooths a mixture until its model passes, and without memory is not flatter than the robot.
    fn smooth(
        &self,
        family: Family,
        note: &mut Option<String>,
        mut fit: impl FnMut(f64) -> Result<Fitted, FitError>,
    ) -> Result<Model, FitError> {
        let mut refusal = None;
        for part in SMOOTHING {
            let fitted = self.checked(family, &fit(part)?);
            let fitted = fitted.and_then(|model| self.not_worse_than_linear(family, model));
            let passed = fitted.and_then(|model| {
                let spot = match family.has_memory() {
                    true => None,
                    false => flat_spot(&model, self.inputs, self.outputs, self.straight),
                };
                spot.map_or(Ok(model), |spot| Err(FitError::TooFlat(spot)))
            });
            match passed {
                Ok(model) if part == 0.0 => return Ok(model),
                Ok(model) => {
                    let words = format!(
                        "{part} of the covariance of all rows was added to every component: with \
                         less, its inverse did not pass, or a straight line was better"
                    );
                    *note = noted_also(note.take(), &words);
                    return Ok(model);
                }
                Err(error) => refusal = refusal.or(Some(error)),
            }
        }
        Err(refusal.unwrap_or(FitError::Mixture(EmError::NoStartSucceeded)))
    }

    fn known_components(&self) -> Option<usize> {
        self.known?.mixture().map(Mixture::components)
    }

    fn gmr(&self, remarks: &mut Remarks) -> Result<Model, FitError> {
        let em = &self.options.em;
        let data = RegressionData::new(self.inputs.clone(), self.outputs.clone());
        let requested = match (self.known_components(), self.options.components) {
            (Some(known), _) => known,
            (None, Components::Exactly(components)) => components,
            (None, Components::UpTo(most)) => {
                choose_components(&data, &tried(most), em, self.progress)
            }
        };
        let fit = data.fit(requested, em, self.progress)?;
        remarks.note = fewer(requested, &fit.mixture, data.most_components());
        self.smooth(Family::Gmr, &mut remarks.note, |part| {
            let mixture = data.smoothed(&fit.mixture, part);
            Ok(self.fitted(FamilyParameters::Gmr { mixture }, (fit.log_likelihood, fit.bic)))
        })
    }

    fn play(&self, remarks: &mut Remarks) -> Result<Model, FitError> {
        let family = Family::GmrPlay;
        let options = |smoothing| ChainOptions {
            components: self.known_components(),
            smoothing,
            em: self.options.em.clone(),
            ..ChainOptions::default()
        };
        let first = fit_play(&self.series, &options(0.0), self.progress);
        let first = first.map_err(|source| failed(family, source))?;
        remarks.mechanism = Some(Mechanism::Plays(first.mechanism.clone()));
        let few = first.chain.mixture.components() < PUBLISHED;
        remarks.note =
            few.then(|| "after the plays, fewer than three components are as good".to_owned());
        let refit = |options: &ChainOptions| {
            let fit = first.refit(&self.series, options, self.progress);
            fit.map_err(|source| failed(family, source))
        };
        let fitted =
            |fit: &PlayFit| self.fitted(fit.family(), (fit.chain.log_likelihood, fit.chain.bic));
        let smooth = self.smooth(family, &mut remarks.note, |part| match part {
            0.0 => Ok(fitted(&first)),
            part => refit(&options(part)).map(|fit| fitted(&fit)),
        });
        smooth.or_else(|refused| {
            // With one motor at a time, a regression may fold between the axes.
            let straight = ChainOptions { components: Some(1), residual: false, ..options(0.0) };
            let model = self.checked(family, &fitted(&refit(&straight)?));
            let model = model.and_then(|model| self.not_worse_than_linear(family, model));
            let model = model.map_err(|_| refused)?;
            let words = "after the plays, a straight line is used: with more its inverse did not \
                         pass";
            remarks.note = Some(words.to_owned());
            Ok(model)
        })
    }

    fn force_balance(&self, remarks: &mut Remarks) -> Result<Model, FitError> {
        let start = match self.known {
            Some(FamilyParameters::ForceBalance { balance, .. }) => Start::Known(balance),
            _ => self.start,
        };
        let fit = fit_force_balance(&self.series, self.no_plane.is_none(), start, self.progress);
        let fit = fit.map_err(|source| failed(Family::ForceBalance, source))?;
        remarks.mechanism = Some(Mechanism::Balance(fit.mechanism));
        remarks.left_out = fit.left_out;
        let checked = |parameters| self.checked(Family::ForceBalance, &Fitted::plain(parameters));
        checked(fit.family).or_else(|refused| {
            fit.simpler.into_iter().find_map(|simpler| checked(simpler).ok()).ok_or(refused)
        })
    }

    fn fitted(&self, family: FamilyParameters, (log_likelihood, bic): (f64, f64)) -> Fitted {
        let (log_likelihood, bic) = (Some(log_likelihood), Some(bic));
        Fitted { family, log_likelihood, bic, restarts: self.options.em.restarts }
    }
}

pub(super) fn tried(most: usize) -> Vec<usize> {
    let few = most.min(PUBLISHED)..=most.min(6);
    few.chain((8..=most).step_by(2)).collect()
}

/// A note if there are fewer components than requested, or than published.
fn fewer(requested: usize, mixture: &Mixture, most: usize) -> Option<String> {
    let left = mixture.components();
    if left < requested {
        let text = format!("{requested} components requested, {left} left: the others got no rows");
        return Some(text);
    }
    let few = requested < PUBLISHED && most < PUBLISHED;
    few.then(|| format!("the rows support only {most} component(s)"))
}

fn failed(family: Family, source: impl Error + Send + Sync + 'static) -> FitError {
    FitError::Family { family, source: Box::new(source) }
}
