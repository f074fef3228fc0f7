//! Outcomes as text, as JSON and as figures.

mod figures;

use std::path::Path;
use std::{fs, mem};

use i2ris_report::number::fixed;
use i2ris_report::{Document, Table};
use serde::Serialize;

use crate::Failure;
use crate::outcome::{Outcome, Percentiles, Quantity, Role, Variant};

/// Writes `NAME.json` and `NAME.svg` of every outcome into a folder, which is created if necessary.
pub fn write_outcomes(folder: &Path, outcomes: &[Outcome]) -> Result<(), Failure> {
    for outcome in outcomes {
        let name = outcome.bench;
        write(folder, &format!("{name}.json"), json(outcome)?.as_bytes())?;
        let figure = figures::percentile_curves(outcome).to_string();
        write(folder, &format!("{name}.svg"), figure.as_bytes())?;
    }
    Ok(())
}

fn json(value: &impl Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    let path = folder.join(name);
    let written = fs::create_dir_all(folder).and_then(|()| fs::write(&path, bytes));
    Ok(written.map_err(|error| {
        format!("cannot write {}: {error}; choose a folder with write permission", path.display())
    })?)
}

/// Prints outcomes as JSON, one object or an array, or as tables.
pub fn print_outcomes(outcomes: &[Outcome], as_json: bool) -> Result<(), Failure> {
    if as_json {
        print!("{}", if let [one] = outcomes { json(one)? } else { json(&outcomes)? });
        return Ok(());
    }
    for outcome in outcomes {
        println!("{}", document(outcome).text(WIDTH));
    }
    let mut summary = Document::new("summary");
    let header = ["", "compared with", "variant", "p50", "p99"];
    let caption = "This run; multiples of the floor.";
    let mut table = Table::new(caption, header).text_column(1).text_column(2);
    for outcome in outcomes {
        for (group, variants) in outcome.groups() {
            let floor = variants.iter().find(|variant| variant.role == Role::Floor);
            let Some(floor) = floor else { continue };
            let mut first = [format!("{}, {group}", outcome.bench), floor.name.clone()];
            for Variant { name, x_floor, .. } in variants {
                let Some(ratio) = x_floor else { continue };
                let ratios = [ratio.p50, ratio.p99].map(|ratio| format!("{ratio:.2}"));
                let cells = mem::take(&mut first).into_iter().chain([name.clone()]);
                table.row(cells.chain(ratios));
            }
        }
    }
    summary.table(table);
    print!("{}", summary.text(WIDTH));
    Ok(())
}

/// Columns of printed sentences; tables may be wider.
const WIDTH: usize = 100;

fn document(outcome: &Outcome) -> Document {
    let mut page = Document::new(format!("{}: {}", outcome.bench, outcome.about));
    let threads = outcome.scheduling.iter().map(|line| ("threads", line.clone()));
    let machine = [("machine", outcome.machine.description())].into_iter().chain(threads);
    page.facts(machine.chain([("load", outcome.load.description())]));
    let header = ["microseconds", "count", "p50", "p90", "p99", "p99.9", "max", "p50 / floor"];
    for (group, variants) in outcome.groups() {
        let mut table = Table::new(group, header);
        for variant in variants {
            let Percentiles { count, p50, p90, p99, p999, max } = variant.percentiles;
            let us = [p50, p90, p99, p999, max].map(|ns| fixed(ns as f64 / 1e3, 2));
            let ratio = variant.x_floor.map_or_else(|| "-".to_owned(), |it| fixed(it.p50, 2));
            let first = [variant.display_name(), count.to_string()].into_iter();
            table.row(first.chain(us).chain([ratio]));
        }
        page.table(table);
    }
    let quantities = outcome.quantities.iter();
    page.section("Further numbers");
    page.facts(
        quantities
            .map(|Quantity { name, value, unit }| (name.clone(), format!("{value:.1} {unit}"))),
    );
    page.facts(outcome.notes.iter().map(|note| ("note", note.clone())));
    page
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::tests::{outcome, variant};

    #[test]
    fn all_files_have_the_same_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let variants = vec![
            variant("least", "polled", Role::Floor, 500),
            variant("ours, <b>", "polled", Role::Ours, 1500),
        ];
        write_outcomes(folder.path(), &[outcome(variants)]).unwrap();
        let text = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
        assert!(text("loop.svg").contains("ours, &lt;b&gt;"));
        let json: serde_json::Value = serde_json::from_str(&text("loop.json")).unwrap();
        let [floor, ours] = [0, 1].map(|index| &json["variants"][index]);
        assert_eq!(ours["role"], "ours");
        assert_eq!(ours["spans_ns"]["count"], 1000);
        assert!(floor["x_floor"].is_null());
        assert!(ours["x_floor"]["p50"].as_f64().unwrap() > 1.5);
    }

    #[test]
    fn an_error_names_the_folder() {
        let text = write_outcomes(Path::new("/proc/nowhere"), &[outcome(Vec::new())])
            .unwrap_err()
            .to_string();
        assert!(text.contains("/proc/nowhere"), "{text}");
    }
}
