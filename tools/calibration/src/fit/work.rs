//! One family after the other, from the same rows.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use i2ris::model::file::{FamilyParameters, OutputUnit};
use i2ris::model::hysteresis::stop::Stops;
use i2ris::model::{Model, ModelError};

use super::{Candidate, FamilyOutcome, FitError, FitOptions, Reading, gmr, refused};
use crate::chain::{ChainFit, ChainOptions, fit_chain};
use crate::components::fewer;
use crate::direction::{DirectionOptions, fit_direction};
use crate::family::{Family, Fitted, Frame};
use crate::identify::Finding;
use crate::kinematic::{KinematicOptions, fit_kinematic};
use crate::linear::LinearFit;
use crate::play::{PlayOptions, fit_play};
use crate::progress::Progress;
use crate::series::Series;
use crate::stop::{StopOptions, fit_stop};
use crate::table::Table;

/// Why the parameters of a family cannot be found.
type Reason = Box<dyn Error + Send + Sync>;

/// What all families are fitted from.
pub(super) struct Work<'a> {
    pub frame: Frame<'a>,
    pub series: Series,
    /// Why the recording tells nothing of hysteresis, if it does not.
    pub hidden: Option<Finding>,
    pub inputs: Table,
    pub outputs: Table,
    pub straight: LinearFit,
    pub options: &'a FitOptions,
    pub progress: &'a dyn Progress,
    pub candidates: Vec<Candidate>,
}

impl Work<'_> {
    /// Fits a family and takes the time.
    pub fn attempt(&mut self, family: Family) -> FamilyOutcome {
        let begin = Instant::now();
        let mut reading = None;
        let result = self.fit(family, &mut reading).map(Arc::new);
        FamilyOutcome {
            family,
            result,
            reading,
            seconds: begin.elapsed().as_secs_f64(),
        }
    }

    fn fit(&mut self, family: Family, reading: &mut Option<Reading>) -> Result<Model, FitError> {
        if family.remembers()
            && let Some(reason) = self.hidden
        {
            return Err(FitError::NoHysteresis(reason));
        }
        match family {
            Family::Linear => self.checked(family, &Fitted::from(&self.straight)),
            Family::Kinematic => self.checked(family, &self.kinematic()?),
            Family::Gmr => self.gmr(),
            Family::GmrDirection => {
                self.with_inverse(family, |components| self.direction(components))
            }
            Family::GmrPlay => self.play(reading),
            Family::GmrStop => self.stop(reading),
        }
    }

    fn checked(&self, family: Family, fitted: &Fitted) -> Result<Model, FitError> {
        self.frame
            .model(fitted)
            .map_err(|source| refused(family, source))
    }

    /// Fits with as many components as do best, and with fewer for as long as the model has no
    /// inverse: the more there are, the more easily the regression folds where the recording says
    /// little.
    fn with_inverse(
        &self,
        family: Family,
        fit: impl Fn(Option<usize>) -> Result<Behind, Reason>,
    ) -> Result<Model, FitError> {
        let mut components = None;
        loop {
            let behind = fit(components).map_err(|source| FitError::Family { family, source })?;
            match self.frame.model(&behind.fitted) {
                Err(ModelError::NotInvertible { .. }) if behind.components > 1 => {
                    components = fewer(behind.components);
                }
                checked => return checked.map_err(|source| refused(family, source)),
            }
        }
    }

    fn gmr(&mut self) -> Result<Model, FitError> {
        let data = gmr::Data {
            inputs: &self.inputs,
            outputs: &self.outputs,
            straight: &self.straight,
        };
        let (model, candidates) = gmr::fit(&self.frame, data, self.options, self.progress)?;
        self.candidates = candidates;
        Ok(model)
    }

    fn kinematic(&self) -> Result<Fitted, FitError> {
        let unit = self
            .frame
            .recording
            .outputs()
            .first()
            .map_or(OutputUnit::Deg, |output| output.unit);
        let parameters = fit_kinematic(&self.series, &KinematicOptions::new(unit));
        Ok(Fitted::plain(
            parameters.map_err(|source| failed(Family::Kinematic, source))?,
        ))
    }

    fn direction(&self, components: Option<usize>) -> Result<Behind, Reason> {
        let options = DirectionOptions {
            components,
            em: self.options.em.clone(),
        };
        let fit = fit_direction(&self.series, &options, self.progress)?;
        Ok(self.behind(
            fit.parameters,
            fit.components,
            (fit.log_likelihood, fit.bic),
        ))
    }

    fn play(&self, reading: &mut Option<Reading>) -> Result<Model, FitError> {
        let family = Family::GmrPlay;
        let first = fit_play(
            &self.series,
            &PlayOptions {
                chain: self.chain(None),
            },
            self.progress,
        );
        let first = first.map_err(|source| failed(family, source))?;
        *reading = Some(Reading::Plays(first.reading.clone()));
        self.with_inverse(family, |components| {
            let fit = match components {
                None => first.clone(),
                fewer => first.refit(&self.series, &self.chain(fewer), self.progress)?,
            };
            let ChainFit {
                mixture,
                log_likelihood,
                bic,
                ..
            } = &fit.chain;
            Ok(self.behind(fit.family(), mixture.weights.len(), (*log_likelihood, *bic)))
        })
    }

    fn stop(&self, reading: &mut Option<Reading>) -> Result<Model, FitError> {
        let options = StopOptions {
            seed: self.options.em.seed,
            ..StopOptions::default()
        };
        let fit = fit_stop(&self.series, &options, self.progress);
        let fit = fit.map_err(|source| failed(Family::GmrStop, source))?;
        *reading = Some(Reading::Stops(fit.reading));
        let stops = fit.parameters;
        self.with_inverse(Family::GmrStop, |components| {
            let chain = self.chain(components);
            let chain = match self.series.motors() {
                1 => fit_chain(
                    &Stops::<1>::prepare(&stops)?,
                    &self.series,
                    &chain,
                    self.progress,
                )?,
                _ => fit_chain(
                    &Stops::<2>::prepare(&stops)?,
                    &self.series,
                    &chain,
                    self.progress,
                )?,
            };
            let ChainFit {
                mixture,
                residual,
                virtual_hull,
                log_likelihood,
                bic,
                ..
            } = chain;
            let components = mixture.weights.len();
            let family = FamilyParameters::GmrStop {
                stops: stops.clone(),
                mixture,
                residual,
                virtual_hull,
            };
            Ok(self.behind(family, components, (log_likelihood, bic)))
        })
    }

    fn chain(&self, components: Option<usize>) -> ChainOptions {
        ChainOptions {
            components,
            em: self.options.em.clone(),
            ..ChainOptions::default()
        }
    }

    fn behind(
        &self,
        family: FamilyParameters,
        components: usize,
        (log_likelihood, bic): (f64, f64),
    ) -> Behind {
        let restarts = self.options.em.restarts;
        let fitted = Fitted {
            family,
            log_likelihood: Some(log_likelihood),
            bic: Some(bic),
            restarts,
        };
        Behind { fitted, components }
    }
}

/// A family with a mixture of so many components.
struct Behind {
    fitted: Fitted,
    components: usize,
}

fn failed(family: Family, source: impl Error + Send + Sync + 'static) -> FitError {
    FitError::Family {
        family,
        source: Box::new(source),
    }
}
