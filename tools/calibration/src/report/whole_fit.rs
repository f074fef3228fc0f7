//! The report of a whole fit.

use super::data::{ChoiceScore, ReportData};
use super::gather::{FamilyFit, gather};
use crate::fit::choice::Score;
use crate::fit::{Choice, Components, FitOptions, FitOutcome};
use crate::recording::{ReadReport, Recording};

/// Everything that a fit found out, for its report.
#[must_use]
pub fn of_fit(
    recording: &Recording,
    read: &ReadReport,
    options: &FitOptions,
    outcome: &FitOutcome,
) -> ReportData {
    let names: Vec<String> =
        outcome.families.iter().map(|family| family.family.to_string()).collect();
    let fitted = outcome.families.iter().zip(&names).filter_map(|(family, name)| {
        let model = family.result.as_deref().ok()?;
        Some(FamilyFit {
            name,
            model,
            chosen: family.family == outcome.family,
            seconds: Some(family.seconds),
        })
    });
    let fitted: Vec<_> = fitted.collect();
    let report = &outcome.report;
    let mut data = gather(recording, &report.survey, &report.split, &report.training, &fitted);
    // The figures are those of the model that had not seen the rows held out; what is written was
    // fitted to all rows.
    if let Some(chosen) = data.families.iter_mut().find(|family| family.chosen) {
        chosen.model_id = outcome.model.id().to_string();
    }
    data.chosen_by_held_out = options.choice == Choice::Best && fitted.len() > 1;
    data.recording.more = read_facts(read, outcome);
    data.choice = choice(outcome);
    data.settings = settings(options);
    data.warnings.extend(failures(outcome));
    data.warnings.extend(flagged(outcome));
    data
}

fn choice(outcome: &FitOutcome) -> Vec<ChoiceScore> {
    let output = outcome.model.file().outputs.first();
    let si = output.map_or(1.0, |output| output.unit.si());
    let score = |score: &Score| ChoiceScore {
        family: score.family.to_string(),
        held_out: score.held_out / si,
        worst_plant: score.worst_plant.map(|(error, plant)| (error / si, plant.to_string())),
        total: score.total() / si,
        travel: score.travel,
        chosen: score.family == outcome.family,
    };
    outcome.report.scores.iter().map(score).collect()
}

fn fact(name: &str, value: impl ToString) -> (String, String) {
    (name.to_owned(), value.to_string())
}

fn read_facts(read: &ReadReport, outcome: &FitOutcome) -> Vec<(String, String)> {
    let mut facts = vec![
        fact("columns of counts", read.counts_columns.join(", ")),
        fact("columns of outputs", read.output_columns.join(", ")),
    ];
    facts.extend(read.time_column.iter().map(|column| fact("column of time", column)));
    facts.push(fact("rows dropped for an empty cell", read.dropped.len()));
    facts.push(fact("rows with positions only", read.positions));
    facts.push(fact("readings flagged as spikes", outcome.report.survey.spikes.len()));
    let latency = outcome.report.survey.latency;
    facts.extend(latency.map(|l| {
        let (ms, deviation) = (1e3 * l.seconds, 1e3 * l.deviation_s);
        fact(
            "outputs are stamped late by",
            format!("{ms:.1} ms (standard deviation {deviation:.1} ms)"),
        )
    }));
    facts.extend(drifts(outcome));
    facts.extend(outcome.families.iter().filter_map(|family| {
        let lines = outcome.reading(family)?;
        Some(fact(&format!("reading of {}", family.family), lines.trim_end().replace('\n', "; ")))
    }));
    facts
}

fn drifts(outcome: &FitOutcome) -> impl Iterator<Item = (String, String)> {
    let drift = &outcome.report.drift;
    let part = if drift.cycles { "cycle" } else { "fifth of the rows" };
    outcome.model.file().outputs.iter().enumerate().map(move |(index, output)| {
        let (per_part, largest) = (drift.per_part(index), drift.largest_step(index));
        let unit = output.unit;
        let text =
            format!("{per_part:+.3} {unit} per {part}, at most {largest:.3} from one to the next");
        fact(&format!("drift of {}", output.name), text)
    })
}

fn settings(options: &FitOptions) -> Vec<(String, String)> {
    let components = match options.components {
        Components::Exactly(components) => components.to_string(),
        Components::UpTo(most) => format!("up to {most}, chosen by the error on blocks left out"),
    };
    vec![
        fact("setting: family", options.choice),
        fact("setting: components of gmr", components),
        fact("setting: starts per mixture", options.em.restarts),
        fact("setting: seed", options.em.seed),
        fact("setting: shrinkage", options.em.shrinkage),
        fact("setting: hold out", options.hold_out),
        fact("setting: train on spikes", if options.spikes.keep { "yes" } else { "no" }),
    ]
}

/// Families that were asked for and are not in the tables.
fn failures(outcome: &FitOutcome) -> impl Iterator<Item = String> {
    let failed = outcome
        .families
        .iter()
        .filter_map(|family| Some((family.family, family.result.as_ref().err()?)));
    failed.map(|(family, reason)| format!("There is no model of the family {family}: {reason}."))
}

fn flagged(outcome: &FitOutcome) -> Option<String> {
    let report = &outcome.report;
    let rows = report.split.held_out().filter(|row| report.survey.is_flagged(*row)).count();
    (rows > 0).then(|| {
        format!(
            "The rows held out hold {rows} that were flagged as spikes; they count in all figures."
        )
    })
}
