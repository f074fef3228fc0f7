//! Models side by side on one recording, and the drift of a robot from a calibration.

use std::{fmt, mem};

use i2ris::model::Model;
use i2ris::model::file::{FitMetrics, OutputSpec};
use i2ris_report::number::fixed;
use i2ris_report::statistics::{mean, quantile_of_unsorted};
use i2ris_report::{Axis, Color, Document, Figure, Mark, Panel, Stroke, Table};
use serde::Serialize;

use crate::drift::{DriftError, DriftEstimate, Value, Verdict};
use crate::fit::metrics::{along, metrics, predictions};
use crate::recording::Recording;

/// Models side by side on one recording. Its `Display` is a table.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub struct Comparison {
    models: Vec<ComparedModel>,
    /// Name, rows with angles, positions of the path.
    #[serde(skip)]
    recording: (String, usize, usize),
    /// Rows with known memory in every model.
    #[serde(skip)]
    common: usize,
}

#[derive(Debug, Serialize)]
struct ComparedModel {
    model: String,
    family: String,
    trained_on_it: bool,
    outputs: Vec<ComparedOutput>,
    rms_length: f64,
    /// Rows at the start with unknown memory.
    unknown_memory: usize,
    /// Rows outside the region that its calibration visited.
    outside: usize,
    /// `rms_length` on the rows known to every compared model; absent if there are none.
    rms_length_of_common: Option<f64>,
    /// The same for every part of the recording.
    #[serde(skip)]
    parts: [Option<f64>; PARTS],
}

/// Parts of a recording; a better model must be better in each.
const PARTS: usize = 5;

/// Errors in the unit of the output.
#[derive(Debug, Serialize)]
struct ComparedOutput {
    name: String,
    unit: String,
    #[serde(flatten)]
    metrics: FitMetrics,
    p99: f64,
}

impl Comparison {
    /// Compares models, with the names of their files, on a recording of the same motors and
    /// outputs. Fails if an output does not vary in the recording.
    pub fn new(models: &[(String, Model)], recording: &Recording) -> Result<Self, String> {
        let (rows, positions) = (recording.rows().len(), recording.path().len());
        let doubts: Vec<_> = models.iter().map(|(_, model)| doubts(model, recording)).collect();
        let is_common = |row: &usize| doubts.iter().all(|of| of[*row] == [false; 2]);
        let common: Vec<usize> = (0..rows).filter(is_common).collect();
        let models = models.iter().zip(&doubts).map(|((name, model), doubts)| {
            ComparedModel::new(name, model, recording, doubts, &common)
        });
        let models = models.collect::<Result<_, _>>()?;
        let recording = (recording.name().to_owned(), rows, positions);
        Ok(Self { models, recording, common: common.len() })
    }

    /// The best model on the rows known to all, and the certainty; `None` without a second one.
    fn verdict(&self) -> Option<String> {
        let known =
            self.models.iter().filter_map(|model| Some((model.rms_length_of_common?, model)));
        let mut ranked: Vec<(f64, &ComparedModel)> = known.collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [(least, best), (more, next), ..] = ranked[..] else { return None };
        let pairs = best.parts.iter().zip(&next.parts);
        let pairs: Vec<(f64, f64)> = pairs.filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
        let (won, parts) = (pairs.iter().filter(|(a, b)| a < b).count(), pairs.len());
        let percent = 100.0 * (more / least - 1.0);
        let sure = if won == parts { "" } else { "; another recording may reverse the order" };
        let flattered = match best.trained_on_it {
            true => "; it was fitted to this recording, so its error is too optimistic",
            false => "",
        };
        Some(format!(
            "{} is the best on the {} rows known to every model: {least:.3} RMS length; the next, \
             {}, leaves {percent:.0} % more, and is worse in {won} of {parts} parts{sure}\
              {flattered}",
            best.model, self.common, next.model
        ))
    }
}

impl ComparedModel {
    fn new(
        name: &str,
        model: &Model,
        recording: &Recording,
        doubts: &[[bool; 2]],
        common: &[usize],
    ) -> Result<Self, String> {
        let predicted = predictions(model, recording);
        let rows = || recording.rows().iter().zip(&predicted);
        let mut outputs = Vec::new();
        for (output, spec) in recording.outputs().iter().enumerate() {
            let pairs = rows().map(|(row, at)| (row.outputs[output], at[output]));
            let mut errors: Vec<f64> = pairs.clone().map(|(m, p)| (m - p).abs()).collect();
            let metrics = metrics(&pairs.collect::<Vec<_>>())
                .ok_or_else(|| format!("{} does not vary in the recording", spec.name))?;
            let p99 = quantile_of_unsorted(&mut errors, 0.99).unwrap_or(f64::NAN);
            let (name, unit) = (spec.name.clone(), spec.unit.to_string());
            outputs.push(ComparedOutput { name, unit, metrics, p99 });
        }
        let square = |output: &ComparedOutput| output.metrics.rmsd * output.metrics.rmsd;
        let squares: Vec<f64> = rows()
            .map(|(row, at)| {
                let pairs = row.outputs.iter().zip(at).take(model.outputs());
                pairs.map(|(measured, at)| (measured - at).powi(2)).sum()
            })
            .collect();
        let rms = |of: &[usize]| mean(of.iter().map(|row| squares[*row])).map(f64::sqrt);
        let bound = |part: usize| part * common.len() / PARTS;
        let parts = std::array::from_fn(|part| rms(&common[bound(part)..bound(part + 1)]));
        Ok(Self {
            rms_length_of_common: rms(common),
            parts,
            unknown_memory: doubts.iter().filter(|[unknown, _]| *unknown).count(),
            outside: doubts.iter().filter(|[_, outside]| *outside).count(),
            model: name.to_owned(),
            family: family(model),
            trained_on_it: model.file().training.data_sha256.contains(recording.sha256()),
            rms_length: outputs.iter().map(square).sum::<f64>().sqrt(),
            outputs,
        })
    }

    /// The parts of the errors that are not due to the model.
    fn remarks(&self, rows: usize, common: usize) -> Vec<String> {
        let Self { unknown_memory, outside, .. } = *self;
        let mut remarks = Vec::new();
        if self.trained_on_it {
            remarks.push("fitted to this recording".to_owned());
        }
        if unknown_memory > 0 {
            remarks.push(format!(
                "the memory is unknown in the first {unknown_memory} of {rows} rows: there the \
                 error may be as large as the hysteresis loop is wide"
            ));
        }
        if outside > 0 {
            let percent = 100.0 * outside as f64 / rows as f64;
            remarks.push(format!(
                "{outside} of {rows} rows ({percent:.0} %) are outside the region that its \
                 calibration visited"
            ));
        }
        remarks.extend(self.rms_length_of_common.filter(|_| common < rows).map(|rms| {
            format!("RMS length on the {common} rows known to every compared model: {rms:.3}")
        }));
        remarks
    }
}

/// For every row: whether the memory is unknown there, and whether it is outside the hull.
fn doubts(model: &Model, recording: &Recording) -> Vec<[bool; 2]> {
    let mut doubts = Vec::with_capacity(recording.rows().len());
    along(model, recording, |row, memory| {
        let counts = &recording.rows()[row].counts;
        doubts.push([!model.is_memory_known(memory), !model.hull().contains(counts)]);
    });
    doubts
}

fn family(model: &Model) -> String {
    let value = serde_json::to_value(&model.file().family).unwrap_or_default();
    value.get("kind").and_then(|kind| kind.as_str()).unwrap_or("?").to_owned()
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, rows, positions) = &self.recording;
        let mut text = Document::new(format!(
            "{name}: {rows} rows with angles on a path of {positions} positions"
        ));
        let header = "model/family/output/R²/RMSD/NRMSD/MAE/p99/max/RMS length".split('/');
        let mut table = Table::new("Errors.", header).text_column(1).text_column(2);
        for model in &self.models {
            let (file, family) = (model.model.clone(), model.family.clone());
            let (mut first, mut length) = ([file, family], fixed(model.rms_length, 3));
            for ComparedOutput { name, unit, metrics, p99 } in &model.outputs {
                let FitMetrics { r2, rmsd, nrmsd, mae, max } = *metrics;
                let cells = mem::take(&mut first).into_iter().chain([format!("{name} ({unit})")]);
                let [r2, nrmsd] = [r2, nrmsd].map(|value| fixed(value, 4));
                let [rmsd, mae, p99, max] = [rmsd, mae, *p99, max].map(|value| fixed(value, 3));
                let numbers = [r2, rmsd, nrmsd, mae, p99, max, mem::take(&mut length)];
                table.row(cells.chain(numbers));
            }
        }
        text.table(table);
        let remarks = self.models.iter();
        let remarks = remarks.map(|model| (&*model.model, model.remarks(*rows, self.common)));
        let remarks = remarks.filter(|(_, remarks)| !remarks.is_empty());
        text.facts(remarks.map(|(model, remarks)| (model, remarks.join("\n"))));
        if let Some(verdict) = self.verdict() {
            text.paragraph(format!("verdict: {verdict}"));
        }
        f.write_str(&text.text(usize::MAX))
    }
}

const HEIGHT: f64 = 165.0;
const BEFORE: Stroke = Stroke::new(Color::PALE, 0.9);
const AFTER: Stroke = Stroke::new(Color::BLUE, 0.9);

/// The drift of a robot from a calibration. Its `Display` has name and numbers.
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
        let caption =
            "Measured minus predicted over time, as calibrated, and with the drift taken out.";
        page.figure(figure, caption);
        page.html()
    }

    fn table(&self) -> Table {
        let caption = "What has changed since the calibration, with standard deviations.";
        let mut table = Table::new(caption, ["", "value", "deviation"]);
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
