//! Figures, tables, machine and notes on one page.

use i2ris_plot::page::TableRow;
use i2ris_plot::{Page, Table};

use super::figure;
use crate::outcome::{Outcome, Role, Way};

/// One page of several outcomes.
#[must_use]
pub fn page(outcomes: &[Outcome]) -> Page {
    let mut page = Page::new("Latencies of i2ris");
    page.main_result(
        "Every way stands beside the least that this machine needs for the same thing, measured in the same run and in turns \
         with it: the floor. Ratios to it carry over to other machines; absolute times do not.",
    );
    if let Some(first) = outcomes.first() {
        page.facts([("machine".to_owned(), first.machine.words())]);
        page.notice(
            "What these numbers show, and what not",
            first.machine.notes(),
        );
    }
    for outcome in outcomes {
        one(&mut page, outcome);
    }
    page.footer(concat!(
        "Written by i2ris ",
        env!("CARGO_PKG_VERSION"),
        ". The same numbers lie beside this page as JSON, the histograms as HDR histogram logs (.hlog, nanoseconds)."
    ));
    page
}

fn one(page: &mut Page, outcome: &Outcome) {
    page.section(format!("{}: {}", outcome.bench, lower(outcome.about)));
    let weather = format!(
        "{:.0} % of all processors in use, {:.1} % stolen by the host",
        outcome.weather.busy_percent, outcome.weather.stolen_percent
    );
    let scheduling = outcome
        .scheduling
        .iter()
        .map(|line| ("scheduling".to_owned(), line.clone()));
    page.facts(scheduling.chain([("meanwhile".to_owned(), weather)]));
    page.figure(
        &figure(outcome),
        "Percentiles: the further right, the rarer. A flat line is a time that is always the same; where it rises, the slowest \
         part of all spans begins.",
    );
    page.table(&table(outcome));
    if !outcome.quantities.is_empty() {
        let number = |value: f64| {
            if value.fract() == 0.0 {
                format!("{value:.0}")
            } else {
                format!("{value:.1}")
            }
        };
        let told = |q: &crate::Quantity| {
            (
                q.name.clone(),
                format!("{} {}", number(q.value), q.unit.replace("us", "µs")),
            )
        };
        page.facts(outcome.quantities.iter().map(told));
    }
    // Those of the machine stand above.
    let general = outcome.machine.notes();
    outcome
        .notes
        .iter()
        .filter(|note| !general.contains(note))
        .for_each(|note| page.paragraph(note.clone()));
}

fn lower(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or_else(String::new, |first| {
        first.to_lowercase().chain(characters).collect()
    })
}

fn table(outcome: &Outcome) -> Table {
    let header = [
        "", "count", "p50", "p90", "p99", "p99.9", "max", "p50 ×", "p99 ×",
    ];
    let mut table = Table::new(
        "Microseconds; in bold what is ours; ×: as a multiple of the floor's.",
        header,
    );
    for group in outcome.groups() {
        table.row(TableRow {
            cells: vec![group.to_owned()],
            rule: true,
            ..TableRow::default()
        });
        outcome
            .ways
            .iter()
            .filter(|way| way.group == group)
            .for_each(|way| table.row(row(outcome, way)));
    }
    table
}

fn row(outcome: &Outcome, way: &Way) -> TableRow {
    let summary = way.spans.summary();
    let us = |ns: u64| match ns {
        0..100_000 => format!("{:.2}", ns as f64 / 1e3),
        _ => format!("{:.0}", ns as f64 / 1e3),
    };
    let role = if way.role == Role::Floor {
        " (floor)"
    } else {
        ""
    };
    let ratio = outcome.ratio(way);
    let times =
        |ratio: Option<f64>| ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.2}"));
    let spans = [
        summary.p50,
        summary.p90,
        summary.p99,
        summary.p999,
        summary.max,
    ]
    .map(us);
    let mut cells = vec![
        format!("\u{2003}{}{role}", way.name),
        summary.count.to_string(),
    ];
    cells.extend(spans);
    cells.extend([
        times(ratio.map(|ratio| ratio.p50)),
        times(ratio.map(|ratio| ratio.p99)),
    ]);
    TableRow {
        cells,
        strong: way.role == Role::Ours,
        rule: false,
    }
}
