//! One family after the other, from the same rows.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use i2ris::model::Model;
use i2ris::model::file::{FamilyParameters, OutputUnit};
use i2ris::model::hysteresis::stop::Stops;

use super::{Candidate, FamilyOutcome, FitError, FitOptions, gmr, joint, refused};
use crate::chain::{ChainFit, ChainOptions, fit_chain};
use crate::direction::{DirectionOptions, fit_direction};
use crate::family::{Family, Fitted, Frame};
use crate::kinematic::{KinematicOptions, fit_kinematic};
use crate::linear::LinearFit;
use crate::motion::hides_hysteresis;
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
        let result = self.fit(family).map(Arc::new);
        FamilyOutcome { family, result, seconds: begin.elapsed().as_secs_f64() }
    }

    fn fit(&mut self, family: Family) -> Result<Model, FitError> {
        if family.remembers()
            && let Some(reason) = hides_hysteresis(self.frame.recording)
        {
            return Err(FitError::NoHysteresis(reason));
        }
        let failed = |source| FitError::Family { family, source };
        let fitted = match family {
            Family::Linear => Fitted::from(&self.straight),
            Family::Kinematic => self.kinematic().map_err(failed)?,
            Family::Gmr => return self.gmr(),
            Family::GmrDirection => self.direction().map_err(failed)?,
            Family::GmrPlay => self.play().map_err(failed)?,
            Family::GmrStop => self.stop().map_err(failed)?,
        };
        self.frame.model(&fitted).map_err(|source| refused(family, source))
    }

    fn gmr(&mut self) -> Result<Model, FitError> {
        let joint = joint(&self.inputs, &self.outputs);
        let (model, candidates) = gmr::fit(&self.frame, &joint, self.options, self.progress)?;
        self.candidates = candidates;
        Ok(model)
    }

    fn kinematic(&self) -> Result<Fitted, Reason> {
        let unit = self.frame.recording.outputs().first().map_or(OutputUnit::Deg, |output| output.unit);
        Ok(Fitted::plain(fit_kinematic(&self.series, &KinematicOptions::new(unit))?))
    }

    fn direction(&self) -> Result<Fitted, Reason> {
        let options = DirectionOptions { components: None, em: self.options.em.clone() };
        let fit = fit_direction(&self.series, &options, self.progress)?;
        Ok(self.with_mixture(fit.parameters, fit.log_likelihood, fit.bic))
    }

    fn play(&self) -> Result<Fitted, Reason> {
        let fit = fit_play(&self.series, &PlayOptions { chain: self.chain() }, self.progress)?;
        Ok(self.with_mixture(fit.family(), fit.chain.log_likelihood, fit.chain.bic))
    }

    fn stop(&self) -> Result<Fitted, Reason> {
        let options = StopOptions { seed: self.options.em.seed, ..StopOptions::default() };
        let stops = fit_stop(&self.series, &options, self.progress)?.parameters;
        let chain = match self.series.motors() {
            1 => fit_chain(&Stops::<1>::prepare(&stops)?, &self.series, &self.chain(), self.progress)?,
            _ => fit_chain(&Stops::<2>::prepare(&stops)?, &self.series, &self.chain(), self.progress)?,
        };
        let ChainFit { mixture, residual, virtual_hull, log_likelihood, bic, .. } = chain;
        let family = FamilyParameters::GmrStop { stops, mixture, residual, virtual_hull };
        Ok(self.with_mixture(family, log_likelihood, bic))
    }

    fn chain(&self) -> ChainOptions {
        ChainOptions { em: self.options.em.clone(), ..ChainOptions::default() }
    }

    fn with_mixture(&self, family: FamilyParameters, log_likelihood: f64, bic: f64) -> Fitted {
        let restarts = self.options.em.restarts;
        Fitted { family, log_likelihood: Some(log_likelihood), bic: Some(bic), restarts }
    }
}
