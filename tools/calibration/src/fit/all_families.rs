//! The fit of all families to a recording, and the choice of the model.

use std::sync::Arc;

use i2ris::model::{Hull, Model};

use super::drift::Drift;
use super::error::{FitError, refused};
use super::family::{Choice, Family};
use super::model_file::FileContext;
use super::one_family::FamilyFitter;
use super::options::FitOptions;
use super::outcome::{FamilyOutcome, FitOutcome, FitReport};
use super::split::Split;
use crate::progress::Progress;
use crate::recording::Recording;
use crate::regression::linear::fit_linear;
use crate::series::Series;
use crate::survey::overview::{Survey, inputs, outputs};

/// Fits models to a recording: looks for spikes, holds rows out, fits, checks as the controller
/// checks, and measures.
///
/// # Errors
///
/// When the recording does not determine a model, or the model that was asked for is refused; see
/// [`FitError`]. With [`Choice::Best`], families that fail are in the outcome.
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
    let inputs = inputs(recording, training.iter().copied());
    let outputs = outputs(recording, training.iter().copied());
    let straight = fit_linear(&inputs, &outputs)?;
    let visited: Vec<_> = training
        .iter()
        .map(|row| recording.rows()[*row].counts)
        .collect();
    let hull = Hull::from_points(recording.motors(), &visited)
        .map_err(|source| refused(Family::Linear, source))?
        .parameters();
    let context = FileContext {
        recording,
        split: &split,
        training: &training,
        hull: &hull,
        robot_id: &options.robot_id,
        seed: options.em.seed,
    };
    let series = Series::new(recording, &training);
    let hidden = survey.hides_hysteresis();
    let mut fitter = FamilyFitter {
        context,
        series,
        hidden,
        inputs,
        outputs,
        straight,
        options,
        progress,
        candidates: Vec::new(),
    };
    let wanted = Family::ALL
        .into_iter()
        .filter(|family| options.choice.includes(*family));
    let mut families: Vec<FamilyOutcome> = wanted.map(|family| fitter.attempt(family)).collect();
    let candidates = fitter.candidates;
    let (linear, family, model) = choose(&mut families, options.choice)?;
    let drift = Drift::new(&model, recording, &usable);
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

/// The affine model, and the family and model to take. An error where there is none.
fn choose(
    families: &mut Vec<FamilyOutcome>,
    choice: Choice,
) -> Result<(Arc<Model>, Family, Arc<Model>), FitError> {
    let model =
        |outcome: &FamilyOutcome| Some((outcome.family, outcome.result.as_ref().ok()?.clone()));
    let eligible = |outcome: &&FamilyOutcome| match choice {
        Choice::Best => true,
        Choice::One(family) => family == outcome.family,
    };
    let is_linear = |outcome: &&FamilyOutcome| outcome.family == Family::Linear;
    let linear = families.iter().find(is_linear).and_then(model);
    let models = families.iter().filter(eligible).filter_map(model);
    let best = models.min_by(|a, b| held_out_error(&a.1).total_cmp(&held_out_error(&b.1)));
    match (linear, best) {
        (Some((_, linear)), Some((family, model))) => Ok((linear, family, model)),
        _ => {
            let failed = families.iter().position(|outcome| outcome.result.is_err());
            let reason = families
                .swap_remove(failed.unwrap_or_default())
                .result
                .err();
            Err(reason.unwrap_or(FitError::NothingToChooseBy))
        }
    }
}

/// Mean square over the held-out rows of the length of the error, in the unit of the outputs.
fn held_out_error(model: &Model) -> f64 {
    let metrics = model.file().metrics.iter();
    metrics
        .map(|output| output.held_out.map_or(0.0, |fit| fit.rmsd * fit.rmsd))
        .sum()
}

fn outputs_change(recording: &Recording, training: &[usize]) -> Result<(), FitError> {
    for (index, spec) in recording.outputs().iter().enumerate() {
        let mut values = training
            .iter()
            .map(|row| recording.rows()[*row].outputs[index]);
        let first = values.next();
        if values.all(|value| Some(value) == first) {
            let output = spec.name.clone();
            return Err(FitError::Constant { output });
        }
    }
    Ok(())
}
