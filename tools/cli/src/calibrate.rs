//! `i2ris calibrate`: recordings and models.

mod collect;
mod compare;
mod fit;
mod guided;
mod merge;
mod refine;

use std::path::Path;

use i2ris::{model::Model, model::file::OutputSpec};
use i2ris_calibration::recording::{ColumnMap, OutputColumn, Recording, TimeColumn};
use i2ris_report::files::{check_overwrite, make_folder_of, replace, same};
use i2ris_report::{Failure, bail};

#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  i2ris calibrate
  i2ris calibrate collect --home --output RECORDING.csv
  i2ris calibrate fit RECORDING.csv --output config/models/snake.json
  i2ris calibrate compare linear.json config/models/snake.json --recording unseen.csv

Without a command it runs every step: collect, fit, compare, use, check, refine. It prints each step
and resumes after an interruption."
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    guided: guided::Arguments,
}

impl Arguments {
    pub fn only_prints(&self) -> bool {
        !matches!(self.command, None | Some(Command::Collect(_)))
    }
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Run a calibration motion and record it
    Collect(collect::Arguments),
    /// Compare models on a recording
    Compare(compare::Arguments),
    /// Fit a model, refine one with a trial, or import a network
    Fit(fit::Arguments),
    /// Insert angles measured later from images
    Merge(merge::Arguments),
}

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.command {
        None => guided::run(&arguments.guided),
        Some(Command::Collect(arguments)) => collect::run(&arguments),
        Some(Command::Compare(arguments)) => compare::run(&arguments),
        Some(Command::Fit(arguments)) => fit::run(&arguments),
        Some(Command::Merge(arguments)) => merge::run(&arguments),
    }
}

/// Columns of a recording.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Columns of the recording")]
pub struct ColumnArguments {
    #[command(flatten)]
    path: PathColumns,
    /// Measured angles, deg, and their names [default: `pitch_deg,yaw_deg` or
    /// `pitches=pitch,yaws=yaw`]
    #[arg(long, value_name = "COLUMN=NAME,..", value_delimiter = ',')]
    angles: Vec<OutputColumn>,
}

/// Columns with the path of the motors.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Columns of the recording")]
pub struct PathColumns {
    /// Encoder counts of motor 0 and motor 1 [default: `q0_counts,q1_counts` or
    /// `Encoder counts 0,Encoder counts 1`]
    #[arg(long, value_name = "COLUMN,..", value_delimiter = ',')]
    counts: Vec<String>,
    /// Time stamps, and their unit if it is not s (ms, us, ns); none: read without time [default:
    /// `t_s`, `time`, `timestamp`, `t_ms`, `Enc TS`, ..., if there is one]
    #[arg(long, value_name = "COLUMN[=UNIT]|none")]
    time: Option<String>,
    /// Unwrap counters of 12, 16 or 32 bits that overflow
    #[arg(long)]
    unwrap: bool,
}

impl PathColumns {
    pub fn map(&self) -> ColumnMap {
        let time = match self.time.as_deref() {
            Some("none") => TimeColumn::Ignored,
            Some(column) => TimeColumn::Named(column.to_owned()),
            None => TimeColumn::Known,
        };
        let (counts, unwrap) = (self.counts.clone(), self.unwrap);
        ColumnMap { time, counts, outputs: Vec::new(), unwrap, still: false, options: true }
    }
}

impl ColumnArguments {
    pub fn map(&self) -> ColumnMap {
        ColumnMap { outputs: self.angles.clone(), ..self.path.map() }
    }
}

/// Checks an output file before the long work. `option` names the file to write.
pub fn check_output(
    option: &str,
    output: &Path,
    recording: &Path,
    overwrite: bool,
) -> Result<(), Failure> {
    let shown = output.display();
    if output.is_dir() {
        bail!("{option} {shown}: is a folder; name a file in it");
    }
    if same(output, recording) {
        bail!("{option} {shown}: is the recording itself; name another file");
    }
    check_overwrite(option, output, overwrite)?;
    Ok(make_folder_of(option, output)?)
}

/// The recording without the confirmed latency of its stamps, and this latency, s.
pub fn without_latency(recording: Recording) -> (Recording, Option<f64>) {
    let (recording, latency) = recording.without_latency();
    if let Err(late) = &latency {
        eprintln!("warning: {}: {}", recording.name(), late.kept());
    }
    (recording, latency.unwrap_or_default())
}

pub fn print_latency(latency: Option<f64>) {
    if let Some(seconds) = latency {
        println!("latency    {:+.1} ms subtracted from the stamps of the angles", 1e3 * seconds);
    }
}

/// Writes a page atomically: a reader finds the old or the new one.
pub fn write(path: &Path, text: &str) -> Result<(), Failure> {
    replace(path, text.as_bytes())
        .map_err(|error| format!("{}: {error}; choose another --report", path.display()).into())
}

pub fn check(model: &Model, recording: &Recording) -> Result<(), String> {
    let [of_model, of_recording] = [model.motors(), recording.motors()];
    if of_model != of_recording {
        return Err(format!("is for {of_model} motor(s), the recording has {of_recording}"));
    }
    let named = |output: &OutputSpec| format!("{} ({})", output.name, output.unit);
    let names = |outputs: &[OutputSpec]| outputs.iter().map(named).collect::<Vec<_>>().join(", ");
    if model.file().outputs != recording.outputs() {
        let (of_model, of_recording) = (names(&model.file().outputs), names(recording.outputs()));
        return Err(format!("has the outputs {of_model}, the recording {of_recording}"));
    }
    Ok(())
}
