//! `i2ris calibrate compare`: model files side by side on one recording.

use std::path::{Path, PathBuf};

use i2ris::model::Model;
use i2ris::model::file::OutputSpec;
use i2ris_calibration::fit::metrics::{metrics, predictions};
use i2ris_calibration::recording::Recording;
use serde::Serialize;

use super::columns::ColumnArguments;
use i2ris_statistics::quantile;
use i2ris_terminal::Failure;
use i2ris_terminal::while_working;

use super::drift;
use super::fit::check_output;

/// Arguments of `i2ris calibrate compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris calibrate compare linear.json gmr.json gmr-play.json --recording unseen.csv
  i2ris calibrate compare config/models/snake.json --recording today.csv --drift --report drift.html

The memory of every model follows the path of the motors through the whole recording, from an
unknown start. Compare on a recording that none of the models was fitted to.")]
pub struct Arguments {
    /// The models
    #[arg(required = true)]
    models: Vec<PathBuf>,
    /// The recording: a CSV file with encoder counts and measured angles
    #[arg(long, value_name = "FILE")]
    recording: PathBuf,
    /// How far the robot is from each calibration: zero, gain and gaps, with their uncertainty, and
    /// whether it is time for a new one
    #[arg(long)]
    drift: bool,
    /// Where to write a page with figures of the drift from the first model
    #[arg(long, value_name = "FILE.html", requires = "drift")]
    report: Option<PathBuf>,
    /// Replace the page, if it exists
    #[arg(long, requires = "report")]
    overwrite: bool,
    /// Print the table as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    columns: ColumnArguments,
}

/// One model.
#[derive(Debug, Serialize)]
struct Entry {
    /// The file.
    model: String,
    family: String,
    /// Whether it was fitted to this recording.
    trained_on_it: bool,
    outputs: Vec<Figures>,
    /// Root mean square length of the error over all outputs, in their unit.
    rms_length: f64,
    /// Rows at the start during which the memory of the model is not known yet.
    unknown_memory: usize,
    /// Rows outside the region that its calibration visited.
    outside: usize,
    /// As `rms_length`, of all other rows; absent without any.
    rms_length_of_others: Option<f64>,
}

/// One output, in its unit.
#[derive(Debug, Serialize)]
struct Figures {
    name: String,
    unit: String,
    r2: f64,
    rmsd: f64,
    nrmsd: f64,
    mae: f64,
    p99: f64,
    max: f64,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(page) = &arguments.report {
        check_output("--report", page, &arguments.recording, arguments.overwrite)?;
    }
    let (recording, _) = Recording::read(&arguments.recording, &arguments.columns.map())?;
    if arguments.drift {
        let (recording, _) = recording.without_latency();
        let load = |file: &PathBuf| {
            let model = load(file, &recording)?;
            Ok((file.display().to_string(), model))
        };
        let models: Result<Vec<_>, Failure> = arguments.models.iter().map(load).collect();
        let page = arguments.report.as_deref();
        return drift::compare(&models?, &recording, page, arguments.json);
    }
    let all = || {
        arguments.models.iter().map(|file| entry(file, &recording)).collect::<Result<Vec<_>, _>>()
    };
    let entries = while_working("comparing", all)?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&entries)?);
    } else {
        print(&entries, &recording);
    }
    Ok(())
}

fn entry(file: &Path, recording: &Recording) -> Result<Entry, Failure> {
    let model = load(file, recording)?;
    let predicted = predictions(&model, recording);
    let mut outputs = Vec::new();
    for (output, spec) in recording.outputs().iter().enumerate() {
        let pairs = recording
            .rows()
            .iter()
            .zip(&predicted)
            .map(|(row, at)| (row.outputs[output], at[output]));
        let mut errors: Vec<f64> =
            pairs.clone().map(|(measured, predicted)| (measured - predicted).abs()).collect();
        errors.sort_by(f64::total_cmp);
        let found = metrics(&pairs.collect::<Vec<_>>())
            .ok_or_else(|| format!("{} does not vary in the recording", spec.name))?;
        outputs.push(Figures {
            name: spec.name.clone(),
            unit: spec.unit.to_string(),
            r2: found.r2,
            rmsd: found.rmsd,
            nrmsd: found.nrmsd,
            mae: found.mae,
            p99: quantile(&errors, 0.99).unwrap_or(f64::NAN),
            max: found.max,
        });
    }
    let trained_on_it = model.file().training.data_sha256 == recording.sha256();
    let rms_length = outputs.iter().map(|figures| figures.rmsd * figures.rmsd).sum::<f64>().sqrt();
    let doubts = Doubts::new(&model, recording);
    let lengths = recording.rows().iter().zip(&predicted).zip(&doubts.rows);
    let others: Vec<f64> = lengths
        .filter(|(_, doubtful)| !**doubtful)
        .map(|((row, at), _)| {
            let pairs = row.outputs.iter().zip(at).take(model.outputs());
            pairs.map(|(measured, at)| (measured - at).powi(2)).sum()
        })
        .collect();
    let rms_of_others = (others.iter().sum::<f64>() / others.len().max(1) as f64).sqrt();
    Ok(Entry {
        unknown_memory: doubts.unknown_memory,
        outside: doubts.outside,
        rms_length_of_others: (!others.is_empty()).then_some(rms_of_others),
        model: file.display().to_string(),
        family: family(&model),
        trained_on_it,
        outputs,
        rms_length,
    })
}

/// Rows of which a model cannot know.
struct Doubts {
    unknown_memory: usize,
    outside: usize,
    /// Of every row: either.
    rows: Vec<bool>,
}

impl Doubts {
    fn new(model: &Model, recording: &Recording) -> Self {
        let (mut memory, mut next) = (model.new_memory(), 0);
        let mut doubts = Self {
            unknown_memory: 0,
            outside: 0,
            rows: Vec::with_capacity(recording.rows().len()),
        };
        for row in recording.rows() {
            for point in &recording.path()[next..=row.path_index] {
                model.advance(&mut memory, &point.counts);
            }
            next = row.path_index + 1;
            let unknown = !model.knows(&memory);
            let outside = !model.hull().contains(&row.counts);
            doubts.unknown_memory += usize::from(unknown);
            doubts.outside += usize::from(outside);
            doubts.rows.push(unknown || outside);
        }
        doubts
    }
}

fn load(file: &Path, recording: &Recording) -> Result<Model, Failure> {
    let model = Model::load(file)?;
    check(&model, recording).map_err(|reason| format!("model {}: {reason}", file.display()))?;
    Ok(model)
}

/// As in the file.
fn family(model: &Model) -> String {
    let value = serde_json::to_value(&model.file().family).unwrap_or_default();
    value.get("kind").and_then(|kind| kind.as_str()).unwrap_or("?").to_owned()
}

/// Whether model and recording are of the same motors and outputs.
pub fn check(model: &Model, recording: &Recording) -> Result<(), String> {
    if model.motors() != recording.motors() {
        return Err(format!(
            "is for {} motor(s), the recording has {}",
            model.motors(),
            recording.motors()
        ));
    }
    let names = |outputs: &[OutputSpec]| {
        outputs
            .iter()
            .map(|output| format!("{} ({})", output.name, output.unit))
            .collect::<Vec<_>>()
            .join(", ")
    };
    if model.file().outputs != recording.outputs() {
        let (of_model, of_recording) = (names(&model.file().outputs), names(recording.outputs()));
        return Err(format!("has the outputs {of_model}, the recording {of_recording}"));
    }
    Ok(())
}

fn print(entries: &[Entry], recording: &Recording) {
    let (rows, places) = (recording.rows().len(), recording.path().len());
    println!(
        "recording  {}: {rows} rows with angles on a path of {places} positions",
        recording.name()
    );
    let header =
        ["R2", "RMSD", "NRMSD", "MAE", "p99", "max"].map(|name| format!(" {name:>9}")).concat();
    println!("\n{:<23} {:<12}{header} {:>12}", "family", "output", "RMS length");
    for entry in entries {
        for (place, figures) in entry.outputs.iter().enumerate() {
            let family = if place == 0 { entry.family.as_str() } else { "" };
            let length =
                if place == 0 { format!(" {:>12.3}", entry.rms_length) } else { String::new() };
            let name = format!("{} ({})", figures.name, figures.unit);
            print!("{family:<23} {name:<12} {:>9.4} {:>9.3}", figures.r2, figures.rmsd);
            print!(" {:>9.4} {:>9.3}", figures.nrmsd, figures.mae);
            println!(" {:>9.3} {:>9.3}{length}", figures.p99, figures.max);
        }
        let trained = if entry.trained_on_it { ", fitted to this very recording" } else { "" };
        println!("  {}{trained}", entry.model);
        doubts(entry, recording.rows().len());
    }
}

/// What the errors of a model include that it cannot know.
fn doubts(entry: &Entry, rows: usize) {
    if entry.unknown_memory > 0 {
        println!(
            "  the memory is unknown in the first {} of {rows} rows: there the error may be as \
             large as the hysteresis loop is wide",
            entry.unknown_memory
        );
    }
    if entry.outside > 0 {
        println!(
            "  {} of {rows} rows ({:.0} %) are outside the region that its calibration visited",
            entry.outside,
            100.0 * entry.outside as f64 / rows as f64
        );
    }
    if let Some(others) = entry.rms_length_of_others
        && entry.unknown_memory + entry.outside > 0
    {
        println!("  RMS length on the other rows: {others:.3}");
    }
}
