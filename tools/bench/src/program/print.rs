//! Prints outcomes as tables.

use i2ris_bench::outcome::Ratio;
use i2ris_bench::{BenchOutcome, Role, Variant};

/// Prints an outcome as a table.
pub fn print(outcome: &BenchOutcome) {
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
        for variant in variants {
            print_variant(variant, outcome.ratio(variant));
        }
    }
    if !outcome.quantities.is_empty() {
        println!();
    }
    for quantity in &outcome.quantities {
        println!("  {:<54} {:>9.1} {}", quantity.name, quantity.value, quantity.unit);
    }
    println!();
    for note in &outcome.notes {
        println!("  note: {note}");
    }
}

/// Prints what each measurement compares with, in the rows of the table in the manual, and the
/// ratios of this run.
pub fn summary(outcomes: &[BenchOutcome]) {
    println!("\nin short (this run; multiples of the floor, p50 / p99):");
    for outcome in outcomes {
        for (group, variants) in outcome.groups() {
            let floor = variants.iter().find(|variant| variant.role == Role::Floor);
            let Some(floor) = floor else { continue };
            println!("  {:<8} {group}, beside {}", outcome.bench, floor.name);
            for variant in &variants {
                if let Some(ratio) = outcome.ratio(variant) {
                    let (name, p50, p99) = (&variant.name, ratio.p50, ratio.p99);
                    println!("  {:<8}   {name:<46} {p50:>7.2} / {p99:.2}", "");
                }
            }
        }
    }
}

fn print_variant(variant: &Variant, ratio: Option<Ratio>) {
    let found = variant.durations.percentiles();
    let us = |ns: u64| format!("{:.2}", ns as f64 / 1e3);
    let [p50, p90, p99, p999, max] =
        [found.p50, found.p90, found.p99, found.p999, found.max].map(us);
    let ratio = ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{:.2}", ratio.p50));
    let (name, count) = (variant.display_name(), found.count);
    println!("  {name:<46} {count:>8} {p50:>9} {p90:>9} {p99:>9} {p999:>9} {max:>10} {ratio:>11}");
}
