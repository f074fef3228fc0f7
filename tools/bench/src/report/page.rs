//! Figures, tables, machine and notes on one page.

use i2ris_report::number::{MISSING, fixed};
use i2ris_report::page::TableRow;
use i2ris_report::{Page, Table};

use super::figures;
use crate::machine::Machine;
use crate::outcome::{Outcome, Percentiles, Quantity, Role, Variant};

/// One page of several outcomes.
pub fn of_outcomes(outcomes: &[Outcome]) -> Page {
    let mut page = Page::new("Latencies of i2ris");
    page.main_result(
        "Every variant is compared with the floor: the least that this machine needs for the same \
         task, measured in the same run and in turns with it. Ratios to the floor are valid on \
         other machines; absolute times are not.",
    );
    if let Some(first) = outcomes.first() {
        write_machine(&mut page, &first.machine);
    }
    for outcome in outcomes {
        write_outcome(&mut page, outcome);
    }
    page.footer(concat!(
        "Written by i2ris ",
        env!("CARGO_PKG_VERSION"),
        ". The same folder has the numbers as JSON."
    ));
    page
}

fn write_machine(page: &mut Page, machine: &Machine) {
    page.facts([("machine".to_owned(), machine.description())]);
    page.notice("What these numbers show, and what they do not show", machine.notes());
}

fn write_outcome(page: &mut Page, outcome: &Outcome) {
    page.section(format!("{}: {}", outcome.bench, outcome.about));
    let load = ("load".to_owned(), outcome.load.description());
    let scheduling = outcome.scheduling.iter().map(|line| ("scheduling".to_owned(), line.clone()));
    page.facts(scheduling.chain([load]));
    if !outcome.variants.is_empty() {
        page.figure(
            &figures::percentile_curves(outcome),
            "Percentiles: the further right, the rarer. A horizontal line is a time that is always \
             the same; where it rises, the slowest part of all durations begins.",
        );
        page.table(&percentiles(outcome));
    }
    if !outcome.quantities.is_empty() {
        page.facts(outcome.quantities.iter().map(|Quantity { name, value, unit }| {
            let value = fixed(*value, usize::from(value.fract() != 0.0));
            (name.clone(), format!("{value} {}", unit.replace("us", "µs")))
        }));
    }
    // The notes of the machine are at the top.
    let general = outcome.machine.notes();
    for note in outcome.notes.iter().filter(|note| !general.contains(note)) {
        page.paragraph(note.clone());
    }
}

fn percentiles(outcome: &Outcome) -> Table {
    let header = ["", "count", "p50", "p90", "p99", "p99.9", "max", "p50 ×", "p99 ×"];
    let caption = "Microseconds; our own variants are bold; ×: as a multiple of the floor.";
    let mut table = Table::new(caption, header);
    for (group, variants) in outcome.groups() {
        let mut heading = TableRow::new([group.to_owned()]);
        heading.rule = true;
        table.row(heading);
        for variant in variants {
            table.row(row(variant));
        }
    }
    table
}

fn row(variant: &Variant) -> TableRow {
    let Percentiles { count, p50, p90, p99, p999, max } = variant.percentiles;
    let us = |ns: u64| fixed(ns as f64 / 1e3, if ns < 100_000 { 2 } else { 0 });
    let times = |ratio: Option<f64>| ratio.map_or(MISSING.to_owned(), |ratio| fixed(ratio, 2));
    let name = [format!("\u{2003}{}", variant.display_name()), count.to_string()];
    let ratio = variant.x_floor;
    let ratios = [ratio.map(|ratio| ratio.p50), ratio.map(|ratio| ratio.p99)].map(times);
    let cells = name.into_iter().chain([p50, p90, p99, p999, max].map(us)).chain(ratios);
    TableRow::new(cells).strong(variant.role == Role::Ours)
}
