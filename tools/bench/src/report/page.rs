//! Figures, tables, machine and notes on one page.

use i2ris_report::number::{MISSING, fixed};
use i2ris_report::page::TableRow;
use i2ris_report::{Page, Table};

use super::figures;
use crate::curves::Growth;
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
        write_machine(&mut page, &first.machine, None);
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

/// The curves of a run.
pub fn of_growth(growth: &Growth) -> Page {
    let mut page = Page::new("How the cost of i2ris grows");
    page.main_result(
        "Cost over size, both logarithmic. The exponent is the slope of the straight line through \
         the logarithms: 1 is linear growth, 0 is none. Exponents are valid on other machines; \
         absolute costs are not.",
    );
    write_machine(&mut page, &growth.machine, Some(&growth.load));
    page.section("Curves");
    page.figure(
        &figures::growth(growth),
        "Every point is the median of a measurement of this run; memory is the peak of a process \
         of its own.",
    );
    page.section("Exponents");
    page.table(&exponents(growth));
    page.footer(concat!("Written by i2ris ", env!("CARGO_PKG_VERSION"), "."));
    page
}

fn write_machine(page: &mut Page, machine: &Machine, load: Option<&str>) {
    let load = load.map(|load| ("load".to_owned(), load.to_owned()));
    page.facts([("machine".to_owned(), machine.description())].into_iter().chain(load));
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

fn exponents(growth: &Growth) -> Table {
    let caption = "From the smallest to the largest size.";
    let header = ["", "over", "from", "to", "cost from", "to", "unit", "exponent"];
    let mut table = Table::new(caption, header);
    for curve in &growth.curves {
        let (Some(first), Some(last)) = (curve.points.first(), curve.points.last()) else {
            continue;
        };
        let number = |value: f64| fixed(value, if value < 10.0 { 2 } else { 0 });
        table.row(TableRow::new([
            curve.name.clone(),
            curve.size.to_owned(),
            fixed(first[0], 0),
            fixed(last[0], 0),
            number(first[1]),
            number(last[1]),
            curve.unit.replace("us", "µs"),
            curve.exponent.map_or_else(String::new, |e| fixed(e, 2)),
        ]));
    }
    table
}
