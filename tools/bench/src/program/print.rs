//! What is printed.

use i2ris_bench::outcome::Ratio;
use i2ris_bench::{Outcome, Role, Summary, Way};

/// An outcome as a table.
pub fn print(outcome: &Outcome) {
    println!("\n{}: {}", outcome.bench, outcome.about);
    println!("  {}", outcome.machine.words());
    outcome
        .scheduling
        .iter()
        .for_each(|line| println!("  {line}"));
    println!(
        "  meanwhile {:.0} % of all processors in use, {:.1} % stolen by the host",
        outcome.weather.busy_percent, outcome.weather.stolen_percent
    );
    println!(
        "\n{:<48} {:>8} {:>9} {:>9} {:>9} {:>9} {:>10} {:>11}",
        "microseconds", "count", "p50", "p90", "p99", "p99.9", "max", "p50 / floor"
    );
    for group in outcome.groups() {
        println!("{group}");
        outcome
            .ways
            .iter()
            .filter(|way| way.group == group)
            .for_each(|way| line(way, outcome.ratio(way)));
    }
    if !outcome.quantities.is_empty() {
        println!();
    }
    for quantity in &outcome.quantities {
        println!(
            "  {:<54} {:>9.1} {}",
            quantity.name, quantity.value, quantity.unit
        );
    }
    println!();
    outcome
        .notes
        .iter()
        .for_each(|note| println!("  note: {note}"));
}

fn line(way: &Way, ratio: Option<Ratio>) {
    let Summary {
        count,
        p50,
        p90,
        p99,
        p999,
        max,
    } = way.spans.summary();
    let us = |ns: u64| format!("{:.2}", ns as f64 / 1e3);
    let role = match way.role {
        Role::Floor => " (floor)",
        Role::Ours | Role::Peer => "",
    };
    let ratio = ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{:.2}", ratio.p50));
    println!(
        "  {:<46} {count:>8} {:>9} {:>9} {:>9} {:>9} {:>10} {ratio:>11}",
        format!("{}{role}", way.name),
        us(p50),
        us(p90),
        us(p99),
        us(p999),
        us(max)
    );
}
