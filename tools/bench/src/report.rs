//! Outcomes as text, as JSON and as figures.

use std::path::Path;
use std::{fs, mem};

use i2ris_report::number::fixed;
use i2ris_report::{Axis, Color, Dash, Document, Figure, Mark, Marker, Panel, Stroke, Table};
use serde::Serialize;

use crate::Failure;
use crate::outcome::{Durations, Outcome, Percentiles, Quantity, Role, Variant};

/// Writes `NAME.json` and `NAME.svg` of every outcome into a folder, which is created if necessary.
pub fn write_outcomes(folder: &Path, outcomes: &[Outcome]) -> Result<(), Failure> {
    for outcome in outcomes {
        let name = outcome.bench;
        write(folder, &format!("{name}.json"), json(outcome)?.as_bytes())?;
        let figure = percentile_curves(outcome).to_string();
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
    let fact = |it: &Quantity| (it.name.clone(), format!("{:.1} {}", it.value, it.unit));
    page.facts(quantities.map(fact));
    page.facts(outcome.notes.iter().map(|note| ("note", note.clone())));
    page
}

/// Height of a panel.
const HEIGHT: f64 = 260.0;
/// Points of a curve per factor of ten.
const POINTS_PER_DECADE: usize = 40;

/// Ticks of the horizontal axis: 1 / (1 - share), and the label.
const TICKS: [(f64, &str); 7] = [
    (1.0, "0 %"),
    (2.0, "50 %"),
    (10.0, "90 %"),
    (100.0, "99 %"),
    (1e3, "99.9 %"),
    (1e4, "99.99 %"),
    (1e5, "99.999 %"),
];

/// A curve ends where fewer durations than this remain.
const MIN_DURATIONS: f64 = 3.0;

/// Colors, dashes and markers of our own variants.
const OURS: [(Color, Dash, Marker); 8] = [
    (Color::BLUE, Dash::Solid, Marker::Circle),
    (Color::VERMILION, Dash::Solid, Marker::Square),
    (Color::GREEN, Dash::Solid, Marker::Triangle),
    (Color::SKY, Dash::Solid, Marker::Diamond),
    (Color::ORANGE, Dash::Solid, Marker::Cross),
    (Color::BLUE, Dash::Long, Marker::Square),
    (Color::VERMILION, Dash::Long, Marker::Triangle),
    (Color::GREEN, Dash::Long, Marker::Circle),
];
/// Dashes of floors, which are black and without markers.
const FLOORS: [Dash; 2] = [Dash::Dashed, Dash::Dotted];
/// Colors, dashes and markers of peers.
const PEERS: [(Color, Dash, Marker); 3] = [
    (Color::GREY, Dash::Dashed, Marker::Cross),
    (Color::ORANGE, Dash::Long, Marker::Diamond),
    (Color::BLACK, Dash::Dotted, Marker::Square),
];

/// Percentiles from the median to one in ten thousand, one panel for each group.
///
/// The horizontal axis is the logarithm of 1 / (1 - share), as in the plots of HdrHistogram: every
/// step to the right leaves a tenth of the durations. It shows the tail.
pub fn percentile_curves(outcome: &Outcome) -> Figure {
    let figure = Figure::new(
        outcome.bench,
        outcome.about,
        "Curves of percentiles, one panel for each group: share of all durations to the right, \
         time upwards, both logarithmic. Floors are black lines without markers.",
    );
    let groups = outcome.groups().into_iter();
    // One legend for all panels: no sign twice.
    let mut used = [0; 3];
    groups.fold(figure, |figure, (name, variants)| {
        figure.row(HEIGHT, vec![panel(name, &variants, &mut used)])
    })
}

fn panel(group: &str, variants: &[&Variant], used: &mut [usize; 3]) -> Panel {
    let ticks = TICKS.map(|(value, label)| (value, label.to_owned())).to_vec();
    let x = Axis::log("share of all that took at most this long").marks(ticks);
    let mut panel = Panel::new(group, x, Axis::log("time (µs)"));
    for variant in variants.iter().filter(|variant| !variant.durations.is_empty()) {
        let points = curve(&variant.durations);
        let index = &mut used[variant.role as usize];
        let line = match variant.role {
            Role::Floor => {
                let dash = FLOORS[*index % FLOORS.len()];
                Mark::line(points, Stroke::new(Color::BLACK, 1.8).dash(dash))
            }
            Role::Ours => marked(points, OURS[*index % OURS.len()]),
            Role::Peer => marked(points, PEERS[*index % PEERS.len()]),
        };
        *index += 1;
        panel = panel.with(line.label(variant.display_name()));
    }
    panel
}

fn marked(points: Vec<[f64; 2]>, (color, dash, marker): (Color, Dash, Marker)) -> Mark {
    Mark::line(points, Stroke::new(color, 1.4).dash(dash)).marker(marker)
}

/// `[1 / (1 - share), us]`.
fn curve(durations: &Durations) -> Vec<[f64; 2]> {
    let histogram = &durations.histogram;
    let decades = (histogram.len() as f64 / MIN_DURATIONS).max(1.0).log10();
    let last = (decades * POINTS_PER_DECADE as f64).ceil() as usize;
    let point = |index: usize| {
        let left = 10f64.powf(decades * index as f64 / last.max(1) as f64);
        [left, histogram.value_at_quantile(1.0 - 1.0 / left) as f64 / 1e3]
    };
    (0..=last).map(point).collect()
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
        let written = write_outcomes(Path::new("/proc/nowhere"), &[outcome(Vec::new())]);
        let text = written.unwrap_err().to_string();
        assert!(text.contains("/proc/nowhere"), "{text}");
    }

    #[test]
    fn a_curve_rises_from_the_least_to_the_tail() {
        let curve = curve(&variant("any", "group", Role::Ours, 1000).durations);
        assert_eq!(curve[0], [1.0, 1.0]);
        for pair in curve.windows(2) {
            assert!(pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1], "{pair:?}");
        }
        let median = curve.iter().find(|point| point[0] >= 2.0).unwrap();
        assert!((1.49..1.53).contains(&median[1]), "{median:?}");
        let [left, us] = curve[curve.len() - 1];
        assert!((left - 1000.0 / MIN_DURATIONS).abs() < 1e-6 && us > 1.99, "{left} {us}");
    }
}
