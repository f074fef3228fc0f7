//! The curves as a page.

use i2ris_plot::number::fixed;
use i2ris_plot::page::TableRow;
use i2ris_plot::{Axis, Color, Dash, Figure, Line, Marker, Page, Panel, Stroke, Table};

use super::{Curve, ScaleOutcome};

/// Height of a row of panels.
const HEIGHT: f64 = 250.0;

const STYLES: [(Color, Dash, Marker); 3] = [
    (Color::BLUE, Dash::Solid, Marker::Circle),
    (Color::VERMILION, Dash::Dashed, Marker::Square),
    (Color::GREEN, Dash::DashDot, Marker::Triangle),
];

/// One page of all curves.
#[must_use]
pub fn page(outcome: &ScaleOutcome) -> Page {
    let mut page = Page::new("How the cost of i2ris grows");
    page.main_result(
        "Cost over size, both logarithmic. The exponent is the slope of the straight line through \
         the logarithms: 1 is linear growth, 0 is none. Exponents are valid on other machines; \
         absolute costs are not.",
    );
    page.facts([
        ("machine".to_owned(), outcome.machine.description()),
        ("load".to_owned(), outcome.load.clone()),
    ]);
    page.notice("What these numbers show, and what they do not show", outcome.machine.notes());
    page.section("Curves");
    page.figure(
        &figure(&outcome.curves),
        "Every point is the median of a measurement of this run; memory is the peak of a process \
         of its own.",
    );
    page.section("Exponents");
    page.table(&table(&outcome.curves));
    page.footer(concat!("Written by i2ris ", env!("CARGO_PKG_VERSION"), "."));
    page
}

fn groups(curves: &[Curve]) -> Vec<Vec<&Curve>> {
    let mut groups: Vec<Vec<&Curve>> = Vec::new();
    for curve in curves {
        match groups.iter_mut().find(|group| group[0].group == curve.group) {
            Some(group) => group.push(curve),
            None => groups.push(vec![curve]),
        }
    }
    groups
}

fn figure(curves: &[Curve]) -> Figure {
    let mut panels: Vec<Panel> = groups(curves).iter().map(|group| panel(group)).collect();
    let mut figure = Figure::new(
        "scale",
        "Cost over size",
        "Panels of cost over size, both axes logarithmic: one for rows, components, plays, rates, \
         clients and axes.",
    );
    while !panels.is_empty() {
        let rest = panels.split_off(panels.len().min(2));
        figure = figure.row(HEIGHT, std::mem::replace(&mut panels, rest));
    }
    figure
}

fn panel(group: &[&Curve]) -> Panel {
    let first = group[0];
    let unit = first.unit.replace("us", "µs");
    let panel = Panel::new(
        first.group.clone(),
        Axis::log(first.size.clone()),
        Axis::log(format!("cost ({unit})")),
    );
    group.iter().zip(STYLES).fold(panel, |panel, (curve, (color, dash, marker))| {
        let line = Line::new(curve.points.clone(), Stroke::new(color, 1.4).dash(dash));
        let label = format!("{} over {} ({})", curve.name, curve.size, exponent(curve));
        panel.with(line.marker(marker).label(label))
    })
}

fn exponent(curve: &Curve) -> String {
    curve.exponent.map_or_else(|| "no exponent".to_owned(), |e| format!("exponent {e:.2}"))
}

fn table(curves: &[Curve]) -> Table {
    let caption = "From the smallest to the largest size.";
    let header = ["", "over", "from", "to", "cost from", "to", "unit", "exponent"];
    let mut table = Table::new(caption, header);
    for curve in curves {
        let (Some(first), Some(last)) = (curve.points.first(), curve.points.last()) else {
            continue;
        };
        let number = |value: f64| fixed(value, if value < 10.0 { 2 } else { 0 });
        table.row(TableRow::new([
            curve.name.clone(),
            curve.size.clone(),
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
