//! The drift of a robot from a calibration.

use std::fmt;

use i2ris::model::Model;
use i2ris::model::file::OutputSpec;
use i2ris_report::{Axis, Color, Document, Figure, Mark, Panel, Stroke, Table};
use serde::Serialize;

use crate::drift::{DriftError, DriftEstimate, Value, Verdict};
use crate::recording::Recording;

const HEIGHT: f64 = 165.0;
const BEFORE: Stroke = Stroke::new(Color::PALE, 0.9);
const AFTER: Stroke = Stroke::new(Color::BLUE, 0.9);

/// The drift of a robot from a calibration. Its `Display` is the name of the model, and its
/// numbers.
#[derive(Debug, Serialize)]
pub struct DriftReport {
    model: String,
    /// Verdict on a new calibration.
    pub verdict: Verdict,
    #[serde(flatten)]
    drift: DriftEstimate,
    #[serde(skip)]
    recording: String,
    #[serde(skip)]
    outputs: Vec<OutputSpec>,
}

impl DriftReport {
    /// The drift from a model, with the name of its file; motors and outputs must be the same.
    pub fn new(name: &str, model: &Model, recording: &Recording) -> Result<Self, DriftError> {
        let drift = DriftEstimate::new(model, recording)?;
        Ok(Self {
            model: name.to_owned(),
            verdict: Verdict::new(model, &drift),
            drift,
            recording: recording.name().to_owned(),
            outputs: recording.outputs().to_vec(),
        })
    }

    /// A page with the numbers, and the errors over time with and without them.
    pub fn html(&self) -> String {
        let Self { model, verdict, drift, recording, outputs } = self;
        let mut page = Document::new(format!("Drift of {model}"));
        let [before, after] = drift.rms;
        let unit = outputs[0].unit;
        page.main_result(format!(
            "On {recording}: {before:.3} {unit}, {after:.3} {unit} without the drift; {verdict}."
        ));
        page.table(self.table());
        let figure = Figure::new(
            "drift",
            "Errors over time",
            "For every output: measured minus predicted, by the model as it is and with the drift \
             taken out.",
        );
        let figure = outputs.iter().enumerate().fold(figure, |figure, (output, spec)| {
            let errors = || drift.errors.iter();
            let before = errors().map(|(time, before, _)| [*time, before[output]]).collect();
            let after = errors().map(|(time, _, after)| [*time, after[output]]).collect();
            let y = Axis::linear(format!("error ({})", spec.unit));
            let panel = Panel::new(&*spec.name, Axis::linear("time (s)"), y)
                .with(Mark::line(before, BEFORE).label("as calibrated"))
                .with(Mark::line(after, AFTER).label("without the drift"))
                .with(Mark::horizontal(0.0, Stroke::new(Color::DARK, 0.6)));
            figure.row(HEIGHT, vec![panel])
        });
        page.figure(
            figure,
            "Measured minus predicted over time, as calibrated, and with the drift taken out.",
        );
        page.html()
    }

    fn table(&self) -> Table {
        let mut table = Table::new(
            "What has changed since the calibration, with standard deviations.",
            ["", "value", "deviation"],
        );
        let mut row = |name: String, Value { value, deviation }: &Value| {
            table.row([name, format!("{value:+.3}"), format!("{deviation:.3}")]);
        };
        for (spec, value) in self.outputs.iter().zip(&self.drift.zero) {
            row(format!("zero of {} ({})", spec.name, spec.unit), value);
        }
        for (spec, values) in self.outputs.iter().zip(&self.drift.gain) {
            for (of, value) in self.outputs.iter().zip(values) {
                row(format!("gain of {} by {}", spec.name, of.name), value);
            }
        }
        for (motor, value) in self.drift.gap_scale.iter().enumerate() {
            row(format!("gap scale of motor {motor}"), value);
        }
        table
    }
}

impl fmt::Display for DriftReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { model, drift, outputs, .. } = self;
        let ([before, after], unit) = (drift.rms, outputs[0].unit);
        let independent = drift.independent * drift.rows as f64;
        writeln!(f, "{model}")?;
        writeln!(
            f,
            "  error      {before:.3} {unit} RMS, {after:.3} {unit} without the drift; {} rows, of \
             which {independent:.0} are independent",
            drift.rows
        )?;
        let with = |value: &Value| format!("{:+.3} +- {:.3}", value.value, value.deviation);
        for (spec, zero) in outputs.iter().zip(&drift.zero) {
            writeln!(f, "  zero       {:<6} {} {}", spec.name, with(zero), spec.unit)?;
        }
        for (spec, row) in outputs.iter().zip(&drift.gain) {
            let row: Vec<String> = row.iter().map(with).collect();
            writeln!(f, "  gain       {:<6} {}", spec.name, row.join("   "))?;
        }
        for (motor, scale) in drift.gap_scale.iter().enumerate() {
            writeln!(f, "  gap scale  motor {motor} {}", with(scale))?;
        }
        Ok(())
    }
}
