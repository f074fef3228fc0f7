//! Outcomes as text, as JSON and as figures.

mod figures;

use std::fs;
use std::path::Path;

use serde::Serialize;

use crate::BenchError;
use crate::outcome::{Outcome, Percentiles, Quantity, Role, Variant};

/// Writes `NAME.json` and `NAME.svg` of every outcome into a folder, which is created if necessary.
pub fn write_outcomes(folder: &Path, outcomes: &[Outcome]) -> Result<(), BenchError> {
    for outcome in outcomes {
        let name = outcome.bench;
        write(folder, &format!("{name}.json"), json(outcome)?.as_bytes())?;
        let figure = figures::percentile_curves(outcome).to_string();
        write(folder, &format!("{name}.svg"), figure.as_bytes())?;
    }
    Ok(())
}

fn json(value: &impl Serialize) -> Result<String, BenchError> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), BenchError> {
    let path = folder.join(name);
    let written = fs::create_dir_all(folder).and_then(|()| fs::write(&path, bytes));
    Ok(written.map_err(|error| {
        format!("cannot write {}: {error}; choose a folder with write permission", path.display())
    })?)
}

/// Prints outcomes as JSON, one object or an array, or as tables.
pub fn print_outcomes(outcomes: &[Outcome], as_json: bool) -> Result<(), BenchError> {
    if as_json {
        print!("{}", if let [one] = outcomes { json(one)? } else { json(&outcomes)? });
        return Ok(());
    }
    outcomes.iter().for_each(print_outcome);
    println!("\nsummary (this run; multiples of the floor, p50 / p99):");
    for outcome in outcomes {
        for (group, variants) in outcome.groups() {
            let floor = variants.iter().find(|variant| variant.role == Role::Floor);
            let Some(floor) = floor else { continue };
            println!("  {:<8} {group}, compared with {}", outcome.bench, floor.name);
            for Variant { name, x_floor, .. } in variants {
                if let Some(ratio) = x_floor {
                    println!("  {:<8}   {name:<46} {:>7.2} / {:.2}", "", ratio.p50, ratio.p99);
                }
            }
        }
    }
    Ok(())
}

fn print_outcome(outcome: &Outcome) {
    println!("\n{}: {}", outcome.bench, outcome.about);
    println!("  {}", outcome.machine.description());
    for line in &outcome.scheduling {
        println!("  {line}");
    }
    println!("  load: {}", outcome.load.description());
    println!(
        "\n{:<48} {:>8} {:>9} {:>9} {:>9} {:>9} {:>10} {:>11}",
        "microseconds", "count", "p50", "p90", "p99", "p99.9", "max", "p50 / floor"
    );
    for (name, variants) in outcome.groups() {
        println!("{name}");
        variants.into_iter().for_each(print_variant);
    }
    if !outcome.quantities.is_empty() {
        println!();
    }
    for Quantity { name, value, unit } in &outcome.quantities {
        println!("  {name:<54} {value:>9.1} {unit}");
    }
    println!();
    for note in &outcome.notes {
        println!("  note: {note}");
    }
}

fn print_variant(variant: &Variant) {
    let Percentiles { count, p50, p90, p99, p999, max } = variant.percentiles;
    let us = |ns: u64| format!("{:.2}", ns as f64 / 1e3);
    let [p50, p90, p99, p999, max] = [p50, p90, p99, p999, max].map(us);
    let ratio = variant.x_floor.map_or_else(|| "-".to_owned(), |ratio| format!("{:.2}", ratio.p50));
    let name = variant.display_name();
    println!("  {name:<46} {count:>8} {p50:>9} {p90:>9} {p99:>9} {p999:>9} {max:>10} {ratio:>11}");
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
