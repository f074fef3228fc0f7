//! The content of a report, computed with the code of the controller.

use i2ris::config::{JointLimitConfig, LimitConfig};
use i2ris::model::file::{FamilyParameters, OutputSpec};
use i2ris::model::{Hull, Model};
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use i2ris_report::statistics::{distance, interpolate, quantile_of_unsorted, root_mean_square};
use std::array;

use super::facts::choice_score;
use super::figures::planar;
use super::fit::{
    Branches, CalibrationReport, Errors, FamilyResult, OutputFacts, RecordingFacts, Straight, Track,
};
use crate::fit::metrics::{clipped_rows, predictions};
use crate::fit::{Choice, Components, FamilyOutcome, FitOptions, FitOutcome, ModelMismatch};
use crate::hand_limits::HandLimits;
use crate::quality::{inputs, outputs};
use crate::recording::{ReadReport, Recording};
use crate::regression::linear::fit_linear;

/// Minimum return of the counts along an output for a change of direction.
const DEAD_BAND_COUNTS: f64 = 1.0;

impl CalibrationReport {
    /// All results of a fit.
    pub fn new(
        recording: &Recording,
        read: &ReadReport,
        options: &FitOptions,
        outcome: &FitOutcome,
    ) -> Self {
        let report = &outcome.report;
        let file = outcome.model.file();
        let facts = output_facts(recording, outcome);
        let track = track(recording, &facts);
        let (clipped, rows) = (clipped_rows(&outcome.model, recording).len(), track.counts.len());
        let family = |family| family_result(family, outcome, recording, &facts, &track);
        let families: Vec<FamilyResult> = outcome.families.iter().filter_map(family).collect();
        let failure = |family: &FamilyOutcome| {
            Some((family.family.to_string(), family.result.as_ref().err()?.to_string()))
        };
        let score = |score| choice_score(score, outcome);
        let (motors, joints) = (LimitConfig::default(), JointLimitConfig::default());
        Self {
            robot_id: file.robot_id.clone(),
            recorded_at: file.training.recorded_at.clone(),
            model_id: outcome.model.id().to_string(),
            recording: recording_facts(recording, read, outcome),
            spikes: report.quality.spikes.clone(),
            latency: report.quality.latency,
            latency_taken_off_s: None,
            warnings: (read.notes.iter().cloned())
                .chain(report.quality.warnings.iter().map(ToString::to_string))
                .collect(),
            failures: outcome.families.iter().filter_map(failure).collect(),
            chosen_by_held_out: options.choice == Choice::Best && families.len() > 1,
            families,
            choice: report.scores.iter().map(score).collect(),
            usable_percent: 100.0 * (1.0 - clipped as f64 / rows as f64),
            hand: Some(HandLimits::new(&outcome.model, &motors, &joints)),
            unexplained: outcome.unexplained(recording),
            beyond_model: ModelMismatch::find(outcome, recording).map(|found| found.to_string()),
            settings: settings(options),
            software: file.training.software.clone(),
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
    let (held_out, counted) = (report.split.held_out().count(), &report.counted);
    let outside = match held_out - counted.len() {
        0 => String::new(),
        rows => format!("; {rows} outside the training hull do not count"),
    };
    RecordingFacts {
        name: recording.name().to_owned(),
        sha256: recording.sha256().to_owned(),
        motors: recording.motors(),
        read: read.clone(),
        training: report.training.len(),
        every: report.every,
        held_out,
        held_out_rows: format!("{}{outside}", report.split.kind()),
        held_out_flagged: counted.iter().filter(|row| report.quality.is_flagged(**row)).count(),
    }
}

fn output_facts(recording: &Recording, outcome: &FitOutcome) -> Vec<OutputFacts> {
    let report = &outcome.report;
    // Where no straight line is determined, the fit has been refused; otherwise it is level.
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
    let facts = |(index, spec): (usize, &OutputSpec)| OutputFacts {
        name: spec.name.clone(),
        unit: spec.unit.to_string(),
        noise: report.quality.noise.get(index).copied().flatten(),
        gain: gain(index).unwrap_or_default(),
        straight: straight(index).unwrap_or_default(),
    };
    recording.outputs().iter().enumerate().map(facts).collect()
}

/// `None` for a family that could not be fitted. The figures are those of the model that had not
/// seen the held-out rows; the chosen model that is written was fitted to all rows.
fn family_result(
    family: &FamilyOutcome,
    outcome: &FitOutcome,
    recording: &Recording,
    facts: &[OutputFacts],
    track: &Track,
) -> Option<FamilyResult> {
    let model = family.result.as_deref().ok()?;
    let file = model.file();
    let chosen = family.family == outcome.family;
    let unit = |index: usize| file.outputs.get(index).map_or(1.0, |output| output.unit.si());
    let branch = |(index, output): (usize, &OutputFacts)| {
        branches(model, index, &output.straight, unit(index))
    };
    let predicted = predictions(model, recording);
    Some(FamilyResult {
        name: family.family.to_string(),
        title: file.family.title(),
        note: family.note.clone(),
        chosen,
        model_id: if chosen { outcome.model.id() } else { model.id() }.to_string(),
        fit_seconds: family.seconds,
        metrics: file.metrics.clone(),
        training: errors(track, &predicted, facts.len(), &outcome.report.training),
        held_out: errors(track, &predicted, facts.len(), &outcome.report.counted),
        reading: outcome.reading(family),
        branches: facts.iter().enumerate().map(branch).collect(),
        mixtures: file.family.mixture().map_or_else(Vec::new, |mixture| {
            let straight: Vec<Straight> = facts.iter().map(|output| output.straight).collect();
            planar(mixture, &straight, recording.motors())
        }),
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
    let p99 = (0..outputs).map(p99).collect::<Option<_>>()?;
    Some(Errors { rms_length: root_mean_square(lengths)?, p99 })
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
        ("hold out", options.hold_out.to_string()),
        ("train on spikes", spikes.to_owned()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec()
}

fn track(recording: &Recording, facts: &[OutputFacts]) -> Track {
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
    }
}

/// Whether the counts along each output rose last, at every row.
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

/// Positions of half a sweep, and time between two of them, which affects creeping snakes, s.
const POSITIONS: usize = 160;
const POSITION_S: f64 = 0.05;

/// Sweeps before the recorded one: they make the memory independent of the past.
const SWEEPS_BEFORE: usize = 3;

/// Halvings down to a millionth of a count from the largest sweep, beyond what motors can do.
const HALVINGS: u32 = 60;
const FURTHEST: f64 = 1e7;

/// Positions of a sweep in a direction through the middle of the calibrated region, from one end to
/// the other. Back and forth it shows the branches of a model.
fn sweep(hull: &Hull, direction: MotorVec) -> Vec<MotorVec> {
    let centre = hull.centre();
    let point = |distance: f64| array::from_fn(|motor| centre[motor] + distance * direction[motor]);
    let end = |sign: f64| {
        let (mut inside, mut outside) = (0.0, sign * FURTHEST);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            if hull.contains(&point(middle)) { inside = middle } else { outside = middle }
        }
        point(inside)
    };
    let (from, to) = (end(-1.0), end(1.0));
    let position = |i: usize| interpolate(&from, &to, i as f64 / (POSITIONS - 1) as f64);
    (0..POSITIONS).map(position).collect()
}

/// The branches of a model for one output; `unit` is the output's unit in rad or m.
pub(super) fn branches(model: &Model, output: usize, straight: &Straight, unit: f64) -> Branches {
    let sweep = sweep(model.hull(), straight.direction());
    let mut memory = model.new_memory();
    let mut point = |counts: &MotorVec| {
        model.advance_over(&mut memory, counts, POSITION_S);
        let mean = model.predict(counts, &memory).mean[output] / unit;
        [straight.along(counts), mean, straight.at(counts)]
    };
    for _ in 0..SWEEPS_BEFORE {
        for counts in sweep.iter().chain(sweep.iter().rev()) {
            point(counts);
        }
    }
    let rising = sweep.iter().map(&mut point).collect();
    let falling = sweep.iter().rev().map(&mut point).collect();
    Branches { rising, falling }
}
