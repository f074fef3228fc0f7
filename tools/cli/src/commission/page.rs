//! The final page: stages, findings with evidence, currents, exchanges, proposed configuration.

use std::fmt::Write as _;

use i2ris_report::{Axis, Color, Document, Figure, Mark, Panel, Stroke, Table};

use super::record::{Change, Outcome, Record};

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
    let table = Table::new("Unknowns", ["unknown", "where", "value", "evidence"]);
    let mut table = (1..4).fold(table, Table::text_column);
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
        let steps = Mark::steps(&edges, &heights, Stroke::new(Color::BLUE, 1.5));
        Panel::new(device, Axis::linear("ms"), Axis::linear("exchanges")).with(steps)
    });
    let description = "Histogram of exchange durations, for every port";
    let figure = Figure::new("exchanges", "Exchanges", description).row(200.0, panels.collect());
    page.figure(figure, "Duration of a request and its reply.");
}

/// The changed text, and the differing lines in `diff` format; empty if nothing differs.
pub fn change(text: &str, name: &str, changes: &[Change]) -> (String, String) {
    let (mut port, mut axis) = (None, None);
    let (mut new, mut out) = (String::new(), String::new());
    let mut open: Vec<&Change> = changes.iter().collect();
    for (number, line) in (1..).zip(text.lines()) {
        let mut changed = line.to_owned();
        match line.split('#').next().unwrap_or_default().trim() {
            "[[ports]]" => (port, axis) = (Some(port.map_or(0, |it: usize| it + 1)), None),
            "[[ports.axes]]" => axis = Some(axis.map_or(0, |it: usize| it + 1)),
            rest => {
                let key = rest.split('=').next().unwrap_or_default().trim();
                let is_it =
                    |it: &&Change| (Some(it.port), it.axis) == (port, axis) && it.key == key;
                if let Some(found) = open.iter().position(is_it) {
                    let Change { key, value, .. } = open.remove(found);
                    let comment = line.find('#').and_then(|at| line.get(at..)).unwrap_or_default();
                    changed = format!("{key} = {value} {comment}").trim_end().to_owned();
                    let _ = writeln!(out, "@@ -{number} +{number} @@\n-{line}\n+{changed}");
                }
            }
        }
        new += &(changed + "\n");
        // A missing key is added below the heading of its block.
        let is_heading = line.trim_start().starts_with("[[ports");
        let is_absent = |it: &&Change| is_heading && (Some(it.port), it.axis) == (port, axis);
        let block = text.lines().skip(number).take_while(|line| !line.trim().starts_with('['));
        let keys = block.filter_map(|line| line.split_once('=')).map(|(key, _)| key.trim());
        let keys: Vec<&str> = keys.collect();
        for Change { key, value, .. } in
            open.extract_if(.., |it| is_absent(it) && !keys.contains(&&*it.key))
        {
            let _ = writeln!(out, "@@ -{number} +{number} @@\n+{key} = {value}");
            let _ = writeln!(new, "{key} = {value}");
        }
    }
    let head = format!("--- {name}\n+++ {name}, proposed\n");
    (new, if out.is_empty() { out } else { head + &out })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changed_keys_of_ports_and_axes_are_diff_lines() {
        let text = include_str!("../../../../config/robot.toml");
        let of = |axis, key: &str, value: &str| {
            let (key, value) = (key.to_owned(), value.to_owned());
            Change { port: 0, axis, key, value }
        };
        let changes = [
            of(None, "family", "\"epos4\""),
            of(Some(1), "serial_number", "0x42"),
            of(Some(2), "streaming", "\"profile\""),
        ];
        let (new, text) = change(text, "robot.toml", &changes);
        let found: toml::Table = new.parse().unwrap();
        assert_eq!(found["ports"][0]["axes"][1]["serial_number"].as_integer(), Some(0x42));
        assert_eq!(found["ports"][0]["axes"][2]["streaming"].as_str(), Some("profile"));
        for part in [
            "-family = \"epos2\" # CHECK\n+family = \"epos4\" # CHECK\n",
            "-serial_number = 0 # CHECK\n+serial_number = 0x42 # CHECK\n",
            " @@\n+streaming = \"profile\"",
        ] {
            assert!(text.contains(part), "{text}");
        }
        assert_eq!(text.matches("\n-").count(), 2, "{text}");
        assert_eq!(change("[[ports]]", "robot.toml", &[]).1, "");
    }
}
