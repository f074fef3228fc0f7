//! The drift on a page.

use i2ris_plot::page::TableRow;
use i2ris_plot::{Axis, Color, Figure, Line, Page, Panel, ReferenceLine, Stroke, Table};

use super::estimate::{DriftEstimate, Value};
use super::verdict::Verdict;
use crate::recording::Recording;

const HEIGHT: f64 = 165.0;

const BEFORE: Stroke = Stroke::new(Color::PALE, 0.9);
const AFTER: Stroke = Stroke::new(Color::BLUE, 0.9);

/// A page with the numbers, and the errors over time with and without them.
#[must_use]
pub fn html(drift: &DriftEstimate, verdict: Verdict, model: &str, recording: &Recording) -> String {
    let mut page = Page::new(format!("Drift of {model}"));
    let [before, after] = drift.rms;
    let unit = recording.outputs()[0].unit;
    page.main_result(format!(
        "On {}: {before:.3} {unit}, {after:.3} {unit} without the drift; {verdict}.",
        recording.name()
    ));
    page.table(&table(drift, recording));
    let rest = &drift.rest;
    page.paragraph(format!(
        "Of what is left, {:.0} % lies along ({:+.2}, {:+.2}); from row to row it has a \
         correlation of {:.2}, to the tenth row {:.2}.",
        100.0 * rest.share,
        rest.direction[0],
        rest.direction[1],
        rest.autocorrelation[0],
        rest.autocorrelation[1],
    ));
    let figure = Figure::new(
        "drift",
        "Errors over time",
        "For every output: measured minus predicted, by the model as it is and with the drift \
         taken out.",
    );
    let outputs = recording.outputs().iter().enumerate();
    let figure = outputs.fold(figure, |figure, (output, spec)| {
        let line = |is_after: bool, stroke| {
            let points = drift.errors.iter().map(|(t, before, after)| {
                let error = if is_after { after } else { before };
                [*t, error[output]]
            });
            Line::new(points.collect(), stroke)
        };
        let panel = Panel::new(
            spec.name.clone(),
            Axis::linear("time (s)"),
            Axis::linear(format!("error ({})", spec.unit)),
        );
        figure.row(
            HEIGHT,
            vec![
                panel
                    .with(line(false, BEFORE).label("as calibrated"))
                    .with(line(true, AFTER).label("without the drift"))
                    .with(ReferenceLine::horizontal(0.0, Stroke::new(Color::DARK, 0.6))),
            ],
        )
    });
    page.figure(
        &figure,
        "Measured minus predicted over time, as calibrated, and with the drift taken out.",
    );
    page.to_string()
}

fn table(drift: &DriftEstimate, recording: &Recording) -> Table {
    let mut table = Table::new(
        "What has changed since the calibration, with standard deviations.",
        ["", "value", "deviation"].map(str::to_owned),
    );
    let mut row = |name: String, value: &Value| {
        let cells = [name, format!("{:+.3}", value.value), format!("{:.3}", value.deviation)];
        table.row(TableRow::new(cells));
    };
    let outputs = recording.outputs();
    for (spec, value) in outputs.iter().zip(&drift.zero) {
        row(format!("zero of {} ({})", spec.name, spec.unit), value);
    }
    for (spec, values) in outputs.iter().zip(&drift.gain) {
        for (of, value) in outputs.iter().zip(values) {
            row(format!("gain of {} by {}", spec.name, of.name), value);
        }
    }
    for (motor, value) in drift.gap_scale.iter().enumerate() {
        row(format!("gap scale of motor {motor}"), value);
    }
    table
}
