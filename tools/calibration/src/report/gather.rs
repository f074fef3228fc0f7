//! The content of a report from models and a recording, computed with the code of the controller.

use i2ris::model::file::{FamilyParameters, HullParameters, MixtureParameters};
use i2ris::model::hysteresis::read_out::ReadOut;
use i2ris::model::{Hull, Model};
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use nalgebra::SVector;

use super::data::{
    FamilyResult, OutputFacts, ProjectedComponent, ReadOutView, RecordingFacts, ReportData,
    SectionPoint, Straight, Track,
};
use super::labels::along;
use super::sweep::{Sweep, branches};
use crate::fit::metrics::predictions;
use crate::fit::split::Split;
use crate::recording::Recording;
use crate::regression::linear::fit_linear;
use crate::survey::overview::{Survey, inputs, outputs};

/// A direction has changed when the counts along an output have come back by so much.
const DEAD_BAND_COUNTS: f64 = 1.0;

/// A model that was fitted.
#[derive(Debug, Clone, Copy)]
pub struct FamilyFit<'a> {
    /// Name of the family.
    pub name: &'a str,
    /// The model.
    pub model: &'a Model,
    /// Whether this is the model that is written.
    pub chosen: bool,
    /// How long the fit took, s, where it was measured.
    pub seconds: Option<f64>,
}

/// The content of a report on models and a recording: all but the settings, warnings and further
/// facts that only the caller knows. `training` are the indices of the rows used for training.
#[must_use]
pub fn gather(
    recording: &Recording,
    survey: &Survey,
    split: &Split,
    training: &[usize],
    families: &[FamilyFit],
) -> ReportData {
    let facts = output_facts(recording, survey, training);
    let track = track(recording, split, training, &facts);
    let robot = families.first().map(|family| family.model.file());
    let chosen = families.iter().find(|family| family.chosen);
    ReportData {
        title: format!("Calibration of {}", robot.map_or("a robot", |file| file.robot_id.as_str())),
        recording: RecordingFacts {
            name: recording.name().to_owned(),
            sha256: recording.sha256().to_owned(),
            robot_id: robot.map_or_else(String::new, |file| file.robot_id.clone()),
            motors: recording.motors(),
            held_out: split.kind().to_string(),
            more: Vec::new(),
        },
        families: families.iter().map(|family| result(family, recording, &facts)).collect(),
        read_out: chosen
            .map_or_else(Vec::new, |family| read_out(family.model, recording, &track, &facts)),
        choice: Vec::new(),
        software: robot.map_or_else(String::new, |file| file.training.software.clone()),
        warnings: survey.warnings.iter().map(|warning| sentence(&warning.to_string())).collect(),
        settings: Vec::new(),
        chosen_by_held_out: false,
        outputs: facts,
        track,
    }
}

/// With a capital letter at the beginning and a full stop at the end.
fn sentence(words: &str) -> String {
    let mut characters = words.chars();
    let first = characters.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", characters.as_str().trim_end_matches('.'))
}

fn output_facts(recording: &Recording, survey: &Survey, training: &[usize]) -> Vec<OutputFacts> {
    // Recordings that determine no straight line were refused before anything was fitted; then it
    // is level.
    let line = fit_linear(
        &inputs(recording, training.iter().copied()),
        &outputs(recording, training.iter().copied()),
    );
    let straight = |index: usize| {
        let fit = line.as_ref().ok()?;
        let mut gain = MotorVec::default();
        for (to, from) in gain.iter_mut().zip(fit.gain.get(index)?) {
            *to = *from;
        }
        Some(Straight { gain, offset: *fit.offset.get(index)? })
    };
    let facts = |(index, spec): (usize, &i2ris::model::file::OutputSpec)| OutputFacts {
        name: spec.name.clone(),
        unit: spec.unit.to_string(),
        noise: survey.noise.get(index).and_then(|noise| noise.map(|noise| noise.deviation)),
        straight: straight(index).unwrap_or_default(),
    };
    recording.outputs().iter().enumerate().map(facts).collect()
}

fn track(recording: &Recording, split: &Split, training: &[usize], facts: &[OutputFacts]) -> Track {
    let rows = recording.rows();
    let start = rows.first().and_then(|row| row.time_s);
    let time = |(index, row): (usize, &crate::recording::Row)| match (row.time_s, start) {
        (Some(time), Some(start)) => time - start,
        _ => index as f64,
    };
    Track {
        time: rows.iter().enumerate().map(time).collect(),
        timed: start.is_some(),
        counts: rows.iter().map(|row| row.counts).collect(),
        rising: rising(recording, facts),
        measured: rows.iter().map(|row| row.outputs).collect(),
        training: training.to_vec(),
        held_out: split.blocks().to_vec(),
    }
}

/// Whether the counts along each output were last seen going up, at every row.
fn rising(recording: &Recording, facts: &[OutputFacts]) -> Vec<[bool; MAX_OUTPUTS]> {
    let mut now = [true; MAX_OUTPUTS];
    // The furthest that the counts have gone in the present direction.
    let mut furthest = [None; MAX_OUTPUTS];
    let states = recording.path().iter().map(|position| {
        for ((now, furthest), output) in now.iter_mut().zip(&mut furthest).zip(facts) {
            let at = output.straight.along(&position.counts);
            let ahead = furthest
                .map_or(0.0, |furthest: f64| if *now { at - furthest } else { furthest - at });
            if ahead < -DEAD_BAND_COUNTS {
                *now = !*now;
            }
            if furthest.is_none() || !(-DEAD_BAND_COUNTS..0.0).contains(&ahead) {
                *furthest = Some(at);
            }
        }
        now
    });
    let states: Vec<_> = states.collect();
    recording.rows().iter().map(|row| states.get(row.path_index).copied().unwrap_or(now)).collect()
}

fn result(family: &FamilyFit, recording: &Recording, facts: &[OutputFacts]) -> FamilyResult {
    let file = family.model.file();
    let unit = |index: usize| file.outputs.get(index).map_or(1.0, |output| output.unit.si());
    let branch = |(index, output): (usize, &OutputFacts)| {
        branches(family.model, index, &output.straight, unit(index))
    };
    FamilyResult {
        name: family.name.to_owned(),
        chosen: family.chosen,
        model_id: family.model.id().to_string(),
        components: mixture(&file.family).map(|mixture| mixture.weights.len()),
        log_likelihood: file.training.log_likelihood,
        bic: file.training.bic,
        fit_seconds: family.seconds,
        predicted: predictions(family.model, recording),
        branches: facts.iter().enumerate().map(branch).collect(),
    }
}

fn mixture(family: &FamilyParameters) -> Option<&MixtureParameters> {
    match family {
        FamilyParameters::Linear { .. } | FamilyParameters::Kinematic { .. } => None,
        FamilyParameters::Gmr { mixture }
        | FamilyParameters::GmrDirection { mixture, .. }
        | FamilyParameters::GmrPlay { mixture, .. }
        | FamilyParameters::GmrPrandtlIshlinskii { mixture, .. }
        | FamilyParameters::GmrStop { mixture, .. } => Some(mixture),
    }
}

/// The region of the mixture's input that was visited, if it is not that of the counts.
fn virtual_hull(family: &FamilyParameters) -> Option<&HullParameters> {
    match family {
        FamilyParameters::Linear { .. }
        | FamilyParameters::Kinematic { .. }
        | FamilyParameters::Gmr { .. }
        | FamilyParameters::GmrDirection { .. } => None,
        FamilyParameters::GmrPlay { virtual_hull, .. }
        | FamilyParameters::GmrPrandtlIshlinskii { virtual_hull, .. }
        | FamilyParameters::GmrStop { virtual_hull, .. } => Some(virtual_hull),
    }
}

/// The mixture of a model along every output; nothing if it has none.
fn read_out(
    model: &Model,
    recording: &Recording,
    track: &Track,
    facts: &[OutputFacts],
) -> Vec<ReadOutView> {
    let file = model.file();
    let Some(mixture) = mixture(&file.family) else {
        return Vec::new();
    };
    let hull = match virtual_hull(&file.family) {
        Some(hull) => Hull::new(hull, model.motors()).ok(),
        None => Some(model.hull().clone()),
    };
    let Some(hull) = hull else { return Vec::new() };
    let mixture = without_further_inputs(mixture, model.motors(), model.outputs());
    let seen = mixture_inputs(model, recording, track);
    let q = if virtual_hull(&file.family).is_some() { 'v' } else { 'q' };
    let view = |(index, output): (usize, &OutputFacts)| {
        let direction = output.straight.direction();
        let what = if q == 'v' { "virtual counts" } else { "counts" };
        ReadOutView {
            input: format!("{} ({what})", along(&direction, model.motors(), q)),
            points: seen
                .iter()
                .map(|(input, outputs)| [output.straight.along(input), outputs[index]])
                .collect(),
            components: components(&mixture, model.motors(), index, direction),
            section: section(&mixture, model, &hull, index, &output.straight),
        }
    };
    facts.iter().enumerate().map(view).collect()
}

/// At the rows used for training: what goes into the mixture, and what it has to explain, which is
/// what was measured less what a residual takes.
fn mixture_inputs(
    model: &Model,
    recording: &Recording,
    track: &Track,
) -> Vec<(MotorVec, [f64; MAX_OUTPUTS])> {
    let mut memory = model.new_memory();
    let mut next = 0;
    let units: Vec<f64> = recording.outputs().iter().map(|output| output.unit.si()).collect();
    let mut at = |row: &usize| {
        let row = recording.rows().get(*row)?;
        for position in recording.path().get(next..=row.path_index)? {
            model.advance(&mut memory, &position.counts);
        }
        next = row.path_index + 1;
        let mut outputs = row.outputs;
        let correction = model.correction(&memory);
        for ((output, part), unit) in outputs.iter_mut().zip(correction).zip(&units) {
            *output -= part / unit;
        }
        Some((model.virtual_counts(&row.counts, &memory), outputs))
    };
    track.training.iter().filter_map(&mut at).collect()
}

/// The mixture of counts and outputs alone, whatever else goes in between: the marginal.
fn without_further_inputs(
    mixture: &MixtureParameters,
    motors: usize,
    outputs: usize,
) -> MixtureParameters {
    let all = mixture.means.first().map_or(0, Vec::len);
    let kept: Vec<usize> = (0..motors).chain(all.saturating_sub(outputs)..all).collect();
    let pick = |row: &Vec<f64>| {
        kept.iter().filter_map(|index| row.get(*index).copied()).collect::<Vec<f64>>()
    };
    MixtureParameters {
        weights: mixture.weights.clone(),
        means: mixture.means.iter().map(pick).collect(),
        covariances: mixture
            .covariances
            .iter()
            .map(|covariance| {
                kept.iter().filter_map(|index| covariance.get(*index)).map(pick).collect()
            })
            .collect(),
    }
}

/// The components in the plane of the input along a direction and one output.
fn components(
    mixture: &MixtureParameters,
    motors: usize,
    output: usize,
    direction: MotorVec,
) -> Vec<ProjectedComponent> {
    let projected = |row: &[f64]| -> f64 {
        row.iter().zip(direction).take(motors).map(|(x, part)| x * part).sum()
    };
    let place = motors + output;
    let one = |((weight, mean), covariance): ((&f64, &Vec<f64>), &Vec<Vec<f64>>)| {
        let along: Vec<f64> = covariance.iter().map(|row| projected(row)).collect();
        let cross = *along.get(place)?;
        let own = *covariance.get(place)?.get(place)?;
        Some(ProjectedComponent {
            weight: *weight,
            mean: [projected(mean), *mean.get(place)?],
            covariance: [[projected(&along), cross], [cross, own]],
        })
    };
    mixture.weights.iter().zip(&mixture.means).zip(&mixture.covariances).filter_map(one).collect()
}

/// The regression through the middle of a hull.
fn section(
    mixture: &MixtureParameters,
    model: &Model,
    hull: &Hull,
    output: usize,
    line: &Straight,
) -> Vec<SectionPoint> {
    let sweep = Sweep::new(hull, line.direction());
    match model.motors() {
        1 => sized_section::<1>(mixture, model, &sweep, output, line),
        _ => sized_section::<2>(mixture, model, &sweep, output, line),
    }
}

fn sized_section<const D: usize>(
    mixture: &MixtureParameters,
    model: &Model,
    sweep: &Sweep,
    output: usize,
    line: &Straight,
) -> Vec<SectionPoint> {
    // A mixture that the model itself was made of is not refused.
    let Ok(regression) = ReadOut::<D>::prepare(mixture, model.outputs()) else {
        return Vec::new();
    };
    let point = |input: MotorVec| {
        let estimate = regression.estimate(&SVector::from_iterator(input.iter().copied().take(D)));
        SectionPoint {
            along: line.along(&input),
            mean: estimate.mean[output],
            deviation: estimate.deviation()[output],
        }
    };
    sweep.positions().map(point).collect()
}
