//! The fit of all families to a recording, and the choice of the model.

use std::sync::Arc;

use i2ris::model::file::{FamilyParameters, HullParameters, OutputSpec};
use i2ris::model::{Hull, Model};

use super::choice::{Score, best, scores};
use super::earlier::{self, take_better, try_others};
use super::metrics::{Evidence, judged_rows, known_from};
use super::model_file::{FileContext, constant_covariance};
use super::one_family::FamilyFitter;
use super::options::{Choice, Family, FitOptions};
use super::outcome::{FamilyOutcome, FitError, FitOutcome, FitReport, noted_also, refused};
use super::split::{HoldOut, Split};
use crate::families::force_balance::search::Start;
use crate::progress::{Progress, Silent};
use crate::quality::{NoiseFloor, Quality, findings, inputs, outputs};
use crate::recording::Recording;
use crate::regression::linear::{LinearFit, fit_linear};
use crate::series::Series;
use crate::table::DataTable;

/// Maximum number of rows used; more rows hardly improve the fit and take time and memory: of
/// longer recordings every second, third, ... row is used. The path of the motors stays whole.
const MAX_ROWS: usize = 20_000;

/// Fits models to a recording: finds spikes, holds rows out, fits, checks like the controller, and
/// measures. Fails if the recording does not determine a model, or the requested model is refused.
/// With [`Choice::Best`], families that fail are in the outcome.
pub fn fit(
    recording: &Recording,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<FitOutcome, FitError> {
    let quality = Quality::new(recording, &options.spikes)?;
    let split = Split::new(recording, options.hold_out)?;
    let earlier = options.earlier.as_ref();
    if (options.choice == Choice::Best || earlier.is_some()) && split.is_empty() {
        return Err(FitError::NothingToChooseBy);
    }
    let start = earlier.map(|it| earlier::balance_of(it, recording, options.choice)).transpose()?;
    let usable = |row: &usize| options.spikes.keep || !quality.is_flagged(*row);
    let every = split.training().count().div_ceil(MAX_ROWS).max(1);
    let training: Vec<usize> = split.training().filter(usable).step_by(every).collect();
    outputs_change(recording, &training)?;
    let data = TrainingData::new(recording, training)?;
    let mut fitter = data.fitter(&quality, &split, options, progress);
    let wanted = Family::ALL.into_iter().filter(|family| options.choice.includes(*family));
    let parts = Parts::new(options);
    let mut families: Vec<FamilyOutcome> = wanted
        .map(|family| {
            parts.announce(family, progress);
            fitter.attempt(family)
        })
        .collect();
    let counted = fitter.context.counted();
    let judges = |row: &usize| usable(row) && counted.binary_search(row).is_ok();
    let judged_rows = judged_rows(&split, known_from(recording), &judges);
    let training: Vec<usize> = fitter.context.training.to_vec();
    let noise = noise_of(&quality, recording);
    let hides_plane = quality.hides_plane().is_some();
    let evidence = Evidence { recording, rows: &judged_rows, noise, hides_plane };
    let own = families.iter_mut().find(|it| it.family == Family::ForceBalance);
    if let Some(own) = own.filter(|_| !judged_rows.is_empty()) {
        parts.announce_starts(0, progress);
        try_others(own, &mut fitter, &evidence);
        if let (Some(earlier), Some(start)) = (earlier, start) {
            parts.announce_starts(1, progress);
            fitter.start = Start::Earlier(start);
            let judgement = take_better(own, fitter.attempt(Family::ForceBalance), &evidence);
            own.note = noted_also(own.note.take(), &judgement.note(earlier, recording));
        }
    }
    let (linear, family, judged, scores) = choose(&mut families, options.choice, &evidence)?;
    let doubt = match (doubt(&judged), options.force) {
        (Some(doubt), false) => return Err(FitError::Worthless { family, doubt }),
        (doubt, _) => doubt,
    };
    let all = (0..recording.rows().len()).filter(usable).step_by(every);
    parts.announce_refit(family, progress);
    let rows = (&quality, &split);
    let model = refit(recording, all.collect(), family, &judged, rows, options, progress);
    let model = marked(model.map_or(judged, Arc::new), doubt);
    let linear = match family {
        Family::Linear => Arc::clone(&model),
        _ => linear,
    };
    Ok(FitOutcome {
        model,
        family,
        linear,
        families,
        report: FitReport { split, quality, training, counted, every, scores, judged: judged_rows },
    })
}

/// RMS length of the noise of the measurement, SI units.
fn noise_of(quality: &Quality, recording: &Recording) -> f64 {
    let noise = quality.noise.iter().zip(recording.outputs());
    let deviation = |noise: &Option<NoiseFloor>| noise.map_or(0.0, |noise| noise.deviation);
    let squares = noise.map(|(noise, output)| (deviation(noise) * output.unit.si()).powi(2));
    squares.sum::<f64>().sqrt()
}

/// A force-balance model of some rows, for properties of the recording alone; from parameters
/// `known` of most of the same rows without a search. `None` if that gives no model.
pub(super) fn balance_of(
    recording: &Recording,
    rows: Vec<usize>,
    known: Option<&FamilyParameters>,
) -> Option<Arc<Model>> {
    let (noise, spikes, warnings) = (Vec::new(), Vec::new(), findings(recording));
    let quality = Quality { noise, spikes, latency: None, warnings };
    let split = Split::new(recording, HoldOut::Blocks).ok()?;
    let data = TrainingData::new(recording, rows).ok()?;
    let options = FitOptions::default();
    let mut fitter = data.fitter(&quality, &split, &options, &Silent);
    fitter.known = known;
    fitter.attempt(Family::ForceBalance).result.ok()
}

/// The parts of the work: every family, and the fit to all rows in the end.
struct Parts {
    choice: Choice,
    /// Of the families, and of all.
    families: f64,
    total: f64,
}

/// Usual duration of the fit to all rows, and of other starts, as in [`Family::usual_duration`].
const REFIT: f64 = 4.0;
const STARTS: f64 = 6.0;

impl Parts {
    fn new(options: &FitOptions) -> Self {
        let choice = options.choice;
        let wanted = Family::ALL.into_iter().filter(|f| choice.includes(*f));
        let families = wanted.map(Family::usual_duration).sum::<f64>();
        let has_balance = choice.includes(Family::ForceBalance);
        let starts = usize::from(has_balance) + usize::from(options.earlier.is_some());
        Self { choice, families, total: families + STARTS * starts as f64 + REFIT }
    }

    fn announce(&self, family: Family, progress: &dyn Progress) {
        let before = Family::ALL.into_iter().take_while(|f| *f != family);
        let before = before.filter(|f| self.choice.includes(*f));
        let begin: f64 = before.map(Family::usual_duration).sum();
        let end = begin + family.usual_duration();
        progress.part(&family.to_string(), begin / self.total, end / self.total);
    }

    /// The part for the shipped snakes or for the earlier calibration.
    fn announce_starts(&self, before: usize, progress: &dyn Progress) {
        let from = self.families + STARTS * before as f64;
        let name = ["other starts", "the earlier calibration"][before.min(1)];
        progress.part(name, from / self.total, (from + STARTS) / self.total);
    }

    fn announce_refit(&self, family: Family, progress: &dyn Progress) {
        let name = format!("{family} to all rows");
        progress.part(&name, 1.0 - REFIT / self.total, 1.0);
    }
}

/// Why a model is worthless: on the held-out rows it is worse than a constant.
fn doubt(model: &Model) -> Option<String> {
    let file = model.file();
    file.outputs.iter().zip(&file.metrics).find_map(|(OutputSpec { name, .. }, metrics)| {
        let r2 = metrics.held_out?.r2;
        let text =
            || format!("on rows held out, R2 of `{name}` is {r2:.2}, below that of a constant");
        (r2 < 0.0).then(text)
    })
}

/// The model with the flag for the controller.
fn marked(model: Arc<Model>, doubt: Option<String>) -> Arc<Model> {
    let Some(doubt) = doubt else { return model };
    let mut file = model.file().clone();
    file.worthless = Some(doubt);
    Model::from_file(file).map_or(model, Arc::new)
}

/// The rows of a fit, and the common input of all families.
pub(super) struct TrainingData<'a> {
    recording: &'a Recording,
    rows: Vec<usize>,
    hull: HullParameters,
    inputs: DataTable,
    outputs: DataTable,
    pub straight: LinearFit,
}

impl<'a> TrainingData<'a> {
    pub fn new(recording: &'a Recording, rows: Vec<usize>) -> Result<Self, FitError> {
        let inputs = inputs(recording, rows.iter().copied());
        let outputs = outputs(recording, rows.iter().copied());
        let straight = fit_linear(&inputs, &outputs)?;
        let visited: Vec<_> = rows.iter().map(|row| recording.rows()[*row].counts).collect();
        let hull = Hull::from_points(recording.motors(), &visited)
            .map_err(|source| refused(Family::Linear, source))?
            .parameters();
        Ok(Self { recording, rows, hull, inputs, outputs, straight })
    }

    pub fn context(
        &'a self,
        quality: &'a Quality,
        split: &'a Split,
        options: &'a FitOptions,
    ) -> FileContext<'a> {
        FileContext {
            recording: self.recording,
            split,
            spikes: (!options.spikes.keep).then_some(quality),
            limits: &quality.warnings,
            training: &self.rows,
            hull: &self.hull,
            straight: &self.straight,
            robot_id: &options.robot_id,
            recorded_at: options.recorded_at.as_deref(),
            drives: &options.drives,
            seed: options.em.seed,
        }
    }

    fn fitter(
        &'a self,
        quality: &'a Quality,
        split: &'a Split,
        options: &'a FitOptions,
        progress: &'a dyn Progress,
    ) -> FamilyFitter<'a> {
        FamilyFitter {
            context: self.context(quality, split, options),
            series: Series::new(self.recording, &self.rows),
            hidden: quality.hides_hysteresis(),
            no_plane: quality.hides_plane(),
            inputs: &self.inputs,
            outputs: &self.outputs,
            straight: &self.straight,
            options,
            known: None,
            start: Start::Typical,
            progress,
        }
    }
}

/// The chosen family, fitted to all rows, because the held-out rows are no longer needed. Errors
/// stay those of the fit that had not seen them. `None` if that gives no model.
fn refit(
    recording: &Recording,
    rows: Vec<usize>,
    family: Family,
    judged: &Model,
    (quality, split): (&Quality, &Split),
    options: &FitOptions,
    progress: &dyn Progress,
) -> Option<Model> {
    if split.is_empty() {
        return None;
    }
    let data = TrainingData::new(recording, rows).ok()?;
    let mut fitter = data.fitter(quality, split, options, progress);
    fitter.known = Some(&judged.file().family);
    let mut refined = fitter.attempt(family).result;
    if refined.is_err() {
        // The choice for most of the rows does not suit all rows.
        fitter.known = None;
        refined = fitter.attempt(family).result;
    }
    let model = refined.ok()?;
    let mut file = model.file().clone();
    let honest = file.metrics.iter_mut().zip(&judged.file().metrics);
    for (metrics, judged) in honest {
        metrics.held_out = judged.held_out;
    }
    file.slow_error = judged.file().slow_error;
    let mut judged = judged.file().family.clone();
    let covariances = constant_covariance(&mut file.family).zip(constant_covariance(&mut judged));
    if let Some((covariance, judged)) = covariances {
        covariance.clone_from(judged);
    }
    Model::from_file(file).ok()
}

/// The affine model, the chosen family and model, and the scores. An error if there is none.
type Choosing = (Arc<Model>, Family, Arc<Model>, Vec<Score>);

fn choose(
    families: &mut Vec<FamilyOutcome>,
    choice: Choice,
    evidence: &Evidence<'_>,
) -> Result<Choosing, FitError> {
    let fitted: Vec<(Family, Arc<Model>)> = families
        .iter()
        .filter_map(|outcome| Some((outcome.family, outcome.result.as_ref().ok()?.clone())))
        .collect();
    let models: Vec<(Family, &Model)> =
        fitted.iter().map(|(family, model)| (*family, &**model)).collect();
    let (scores, family) = match choice {
        Choice::Best => {
            let scores = scores(&models, evidence);
            let best = best(&scores);
            (scores, best)
        }
        Choice::One(family) => (Vec::new(), Some(family)),
    };
    let of = |wanted: Family| fitted.iter().find(|(family, _)| *family == wanted);
    match (of(Family::Linear), family.and_then(of)) {
        (Some((_, linear)), Some((family, model))) => {
            Ok((linear.clone(), *family, model.clone(), scores))
        }
        _ => {
            let failed = families.iter().position(|outcome| outcome.result.is_err());
            let reason = families.swap_remove(failed.unwrap_or_default()).result.err();
            Err(reason.unwrap_or(FitError::NothingToChooseBy))
        }
    }
}

pub(super) fn outputs_change(recording: &Recording, training: &[usize]) -> Result<(), FitError> {
    for (index, spec) in recording.outputs().iter().enumerate() {
        let mut values = training.iter().map(|row| recording.rows()[*row].outputs[index]);
        let first = values.next();
        if values.all(|value| Some(value) == first) {
            return Err(FitError::Constant(spec.name.clone()));
        }
    }
    Ok(())
}
