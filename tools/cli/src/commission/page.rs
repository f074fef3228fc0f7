//! The final page: stages, findings with evidence, currents, exchanges, and the proposed
//! configuration.

use i2ris_report::{Axis, Color, Document, Figure, Mark, Panel, Stroke, Table};

use super::proposal::change;
use super::record::{Outcome, Record};

pub fn page(record: &Record, config_name: &str) -> Document {
    let mut page = Document::new(format!("Commissioning of {}", record.robot_id));
    page.main_result(record.sum());
    page.section("Stages");
    let mut table = Table::new("Stages", ["stage", "when", "outcome", "what"]);
    table = table.text_column(2).text_column(3);
    for it in &record.stages {
        let outcome = format!("{:?}", it.outcome).to_lowercase();
        let cells = [it.stage.to_string(), it.at.clone(), outcome, it.text.clone()];
        table.row(cells).strong = it.outcome != Outcome::Done;
    }
    page.table(table);
    page.section("Findings");
    let mut table = words("Unknowns", ["unknown", "where", "value", "evidence"]);
    for it in record.all_findings() {
        table.row([it.topic.name().to_owned(), it.place, it.value, it.evidence]);
    }
    page.table(table);
    currents(&mut page, record);
    exchanges(&mut page, record);
    if !record.differences.is_empty() {
        page.section("Settings that differ");
        record.differences.iter().for_each(|line| page.paragraph(line.clone()));
    }
    page.section("Proposed configuration");
    let (_, lines) = change(&record.config, config_name, &record.changes);
    if lines.is_empty() {
        page.paragraph("No changes.");
    }
    lines.lines().for_each(|line| page.paragraph(line));
    page.footer(format!(
        "i2ris commission, {}. The bytes of every stage are next to this page (.pcapng): `i2ris \
         doctor wire` prints them.",
        record.software
    ));
    page
}

fn words<const N: usize>(caption: &str, header: [&str; N]) -> Table {
    (1..N).fold(Table::new(caption, header), Table::text_column)
}

fn currents(page: &mut Document, record: &Record) {
    if record.sweeps.is_empty() {
        return;
    }
    page.section("Current after a reversal");
    let panels = record.sweeps.iter().map(|sweep| {
        let first = sweep.back.first().map_or(0, |it| it.0);
        let points = sweep.back.iter().map(|(at, ma)| [f64::from(first - at), f64::from(*ma)]);
        Panel::new(&sweep.place, Axis::linear("counts"), Axis::linear("mA").including(0.0))
            .with(Mark::line(points.collect(), Stroke::new(Color::BLUE, 1.5)))
    });
    let description = "Motor current over the counts after a reversal, for every motor";
    let figure = Figure::new("currents", "Currents", description).row(200.0, panels.collect());
    page.figure(figure, "A step marks the end of the gear play.");
}

fn exchanges(page: &mut Document, record: &Record) {
    if record.exchanges.is_empty() {
        return;
    }
    page.section("Exchanges");
    let panels = record.exchanges.iter().map(|(device, bars)| {
        let width = super::reading::BAR_US;
        // Gaps between bars are bars of zero height.
        let (mut edges, mut heights) = (Vec::new(), Vec::new());
        for &(at, count) in bars {
            if let Some(&last) = edges.last()
                && last < f64::from(at)
            {
                edges.push(f64::from(at));
                heights.push(0.0);
            }
            if edges.is_empty() {
                edges.push(f64::from(at));
            }
            edges.push(f64::from(at + width));
            heights.push(f64::from(count));
        }
        let edges: Vec<f64> = edges.iter().map(|us| us / 1000.0).collect();
        Panel::new(device, Axis::linear("ms"), Axis::linear("exchanges")).with(Mark::steps(
            &edges,
            &heights,
            Stroke::new(Color::BLUE, 1.5),
        ))
    });
    let description = "Histogram of exchange durations, for every port";
    let figure = Figure::new("exchanges", "Exchanges", description).row(200.0, panels.collect());
    page.figure(figure, "Duration of a request and its reply.");
}
