//! The content of a report, computed with the code of the controller.

use i2ris::model::file::{FamilyParameters, HullParameters, MixtureParameters, ModelFile};
use i2ris::model::hysteresis::read_out::ReadOut;
use i2ris::model::{Hull, Model, ModelError};
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use i2ris_report::statistics::{distance, quantile_of_unsorted, root_mean_square};
use nalgebra::SVector;

use super::choice;
use super::fit::{
    CalibrationReport, CandidateFacts, Errors, FamilyResult, OutputFacts, ProjectedComponent,
    ReadOutView, RecordingFacts, SectionPoint, Straight, Track,
};
use super::labels::along;
use super::sweep::{Sweep, branches};
use crate::fit::metrics::predictions;
use crate::fit::outcome::FamilyOutcome;
use crate::fit::split::Split;
use crate::fit::{Candidate, Choice, Components, FitOptions, FitOutcome, Verdict};
use crate::quality::{inputs, outputs};
use crate::recording::{ReadReport, Recording};
use crate::regression::linear::fit_linear;

/// A direction has changed when the counts along an output have come back by so much.
const DEAD_BAND_COUNTS: f64 = 1.0;

impl CalibrationReport {
    /// Everything that a fit found out.
    #[must_use]
    pub fn new(
        recording: &Recording,
        read: &ReadReport,
        options: &FitOptions,
        outcome: &FitOutcome,
    ) -> Self {
        let report = &outcome.report;
        let file = outcome.model.file();
        let facts = output_facts(recording, outcome);
        let track = track(recording, &report.split, &report.training, &facts);
        let family = |family| family_result(family, outcome, recording, &facts, &track);
        let families: Vec<FamilyResult> = outcome.families.iter().filter_map(family).collect();
        let failure = |family: &FamilyOutcome| {
            Some((family.family.to_string(), family.result.as_ref().err()?.to_string()))
        };
        let chosen = outcome.families.iter().find(|family| family.family == outcome.family);
        let chosen = chosen.and_then(|family| family.result.as_deref().ok());
        let view = |model| read_out(model, recording, &track, &facts);
        Self {
            robot_id: file.robot_id.clone(),
            recorded_at: file.training.recorded_at.clone(),
            model_id: outcome.model.id().to_string(),
            recording: recording_facts(recording, read, outcome),
            spikes: report.quality.spikes.clone(),
            latency: report.quality.latency,
            latency_taken_off_s: None,
            warnings: report.quality.warnings.iter().map(ToString::to_string).collect(),
            failures: outcome.families.iter().filter_map(failure).collect(),
            chosen_by_held_out: options.choice == Choice::Best && families.len() > 1,
            families,
            choice: report
                .scores
                .iter()
                .map(|score| choice::choice_score(score, outcome))
                .collect(),
            plays: report.plays.map(|plays| plays / choice::unit(outcome).si()),
            candidates: report.candidates.iter().map(candidate).collect(),
            max_components: match options.components {
                Components::UpTo(most) => Some(most),
                Components::Exactly(_) => None,
            },
            starts: options.em.restarts,
            settings: settings(options),
            software: file.training.software.clone(),
            read_out: chosen.map_or_else(Vec::new, view),
            outputs: facts,
            track,
        }
    }
}

fn recording_facts(
    recording: &Recording,
    read: &ReadReport,
    outcome: &FitOutcome,
) -> RecordingFacts {
    let report = &outcome.report;
    let flagged = report.split.held_out().filter(|row| report.quality.is_flagged(*row));
    RecordingFacts {
        name: recording.name().to_owned(),
        sha256: recording.sha256().to_owned(),
        motors: recording.motors(),
        read: read.clone(),
        training: report.training.len(),
        every: report.every,
        held_out: report.split.held_out().count(),
        held_out_rows: report.split.kind().to_string(),
        held_out_flagged: flagged.count(),
        drift_per: if report.drift.cycles { "cycle" } else { "fifth of the rows" }.to_owned(),
    }
}

fn output_facts(recording: &Recording, outcome: &FitOutcome) -> Vec<OutputFacts> {
    let report = &outcome.report;
    // Recordings that determine no straight line were refused before anything was fitted; then it
    // is level.
    let training = || report.training.iter().copied();
    let line = fit_linear(&inputs(recording, training()), &outputs(recording, training()));
    let straight = |index: usize| {
        let fit = line.as_ref().ok()?;
        let mut gain = MotorVec::default();
        for (to, from) in gain.iter_mut().zip(fit.gain.get(index)?) {
            *to = *from;
        }
        Some(Straight { gain, offset: *fit.offset.get(index)? })
    };
    let gain = |index: usize| match &outcome.linear.file().family {
        FamilyParameters::Linear { gain, .. } => gain.get(index).cloned(),
        _ => None,
    };
    let facts = |(index, spec): (usize, &i2ris::model::file::OutputSpec)| OutputFacts {
        name: spec.name.clone(),
        unit: spec.unit.to_string(),
        noise: report.quality.noise.get(index).copied().flatten(),
        drift: [report.drift.per_part(index), report.drift.largest_step(index)],
        gain: gain(index).unwrap_or_default(),
        straight: straight(index).unwrap_or_default(),
    };
    recording.outputs().iter().enumerate().map(facts).collect()
}

/// Nothing for a family that could not be fitted. The figures are those of the model that had not
/// seen the rows held out; the chosen model that is written was fitted to all rows.
fn family_result(
    family: &FamilyOutcome,
    outcome: &FitOutcome,
    recording: &Recording,
    facts: &[OutputFacts],
    track: &Track,
) -> Option<FamilyResult> {
    let model = family.result.as_deref().ok()?;
    let file: &ModelFile = model.file();
    let chosen = family.family == outcome.family;
    let unit = |index: usize| file.outputs.get(index).map_or(1.0, |output| output.unit.si());
    let branch = |(index, output): (usize, &OutputFacts)| {
        branches(model, index, &output.straight, unit(index))
    };
    let predicted = predictions(model, recording);
    let held_out: Vec<usize> = track.held_out().collect();
    Some(FamilyResult {
        name: family.family.to_string(),
        chosen,
        model_id: if chosen { outcome.model.id() } else { model.id() }.to_string(),
        components: mixture(&file.family).map(|mixture| mixture.weights.len()),
        log_likelihood: file.training.log_likelihood,
        bic: file.training.bic,
        fit_seconds: family.seconds,
        metrics: file.metrics.clone(),
        training: errors(track, &predicted, facts.len(), &track.training),
        held_out: errors(track, &predicted, facts.len(), &held_out),
        reading: outcome.reading(family),
        branches: facts.iter().enumerate().map(branch).collect(),
        predicted,
    })
}

fn errors(
    track: &Track,
    predicted: &[[f64; MAX_OUTPUTS]],
    outputs: usize,
    rows: &[usize],
) -> Option<Errors> {
    let pairs = rows.iter().map(|row| (&track.measured[*row], &predicted[*row]));
    let lengths = pairs.clone().map(|(a, b)| distance(&a[..outputs], &b[..outputs]));
    let p99 = |output: usize| {
        let mut errors: Vec<f64> =
            pairs.clone().map(|(a, b)| (a[output] - b[output]).abs()).collect();
        quantile_of_unsorted(&mut errors, 0.99)
    };
    Some(Errors {
        rms_length: root_mean_square(lengths)?,
        p99: (0..outputs).map(p99).collect::<Option<_>>()?,
    })
}

fn candidate(candidate: &Candidate) -> CandidateFacts {
    let fit = candidate.fit.as_ref();
    CandidateFacts {
        components: candidate.components,
        log_likelihood: fit.map(|fit| fit.log_likelihood),
        spread: fit.map_or(0.0, |fit| fit.starts.spread()),
        failed_starts: fit.map_or(0, |fit| fit.starts.failures.len()),
        converged: fit.is_some_and(|fit| fit.converged),
        bic: fit.map_or(0.0, |fit| fit.bic),
        left_out: candidate.left_out_rms,
        chosen: matches!(candidate.verdict, Verdict::Chosen),
        verdict: match &candidate.verdict {
            Verdict::Chosen => "chosen",
            Verdict::Surpassed => "",
            Verdict::Refused(ModelError::NotInvertible { .. }) => {
                "refused: its inverse fails in the hull"
            }
            Verdict::Refused(_) => "refused",
            Verdict::TooFlat(_) => "refused: too flat somewhere",
            Verdict::Failed(_) => "no start succeeded",
        },
    }
}

fn settings(options: &FitOptions) -> Vec<(String, String)> {
    let components = match options.components {
        Components::Exactly(components) => components.to_string(),
        Components::UpTo(most) => format!("up to {most}, chosen by the error on blocks left out"),
    };
    let spikes = if options.spikes.keep { "yes" } else { "no" };
    [
        ("family", options.choice.to_string()),
        ("components of gmr", components),
        ("starts per mixture", options.em.restarts.to_string()),
        ("seed", options.em.seed.to_string()),
        ("shrinkage", options.em.shrinkage.to_string()),
        ("hold out", options.hold_out.to_string()),
        ("train on spikes", spikes.to_owned()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec()
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

fn mixture(family: &FamilyParameters) -> Option<&MixtureParameters> {
    match family {
        FamilyParameters::Gmr { mixture }
        | FamilyParameters::GmrDirection { mixture, .. }
        | FamilyParameters::GmrPlay { mixture, .. } => Some(mixture),
        _ => None,
    }
}

/// The region of the mixture's input that was visited, if it is not that of the counts.
fn virtual_hull(family: &FamilyParameters) -> Option<&HullParameters> {
    match family {
        FamilyParameters::GmrPlay { virtual_hull, .. }
        | FamilyParameters::ForceBalance { virtual_hull, .. } => Some(virtual_hull),
        _ => None,
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
