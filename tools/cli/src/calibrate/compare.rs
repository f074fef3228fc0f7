//! `i2ris calibrate compare`: model files side by side on one recording.

use std::path::{Path, PathBuf};

use i2ris::model::Model;
use i2ris::model::file::OutputSpec;
use i2ris_calibration::recording::{ColumnMap, OutputColumn, Recording, TimeColumn};
use i2ris_calibration::report::{Comparison, DriftReport};
use i2ris_report::{Failure, while_working};

use super::fit::{check_output, write};

/// Arguments of `i2ris calibrate compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris calibrate compare linear.json gmr.json force-balance.json --recording unseen.csv
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

/// Which columns of a recording are what.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Columns of the recording")]
pub struct ColumnArguments {
    /// Encoder counts of motor 0 and motor 1 [default: `q0_counts,q1_counts` or
    /// `Encoder counts 0,Encoder counts 1`]
    #[arg(long, value_name = "COLUMN,..", value_delimiter = ',')]
    counts: Vec<String>,
    /// Measured angles, deg, and what they are [default: `pitch_deg,yaw_deg` or
    /// `pitches=pitch,yaws=yaw`]
    #[arg(long, value_name = "COLUMN=NAME,..", value_delimiter = ',')]
    angles: Vec<OutputColumn>,
    /// Time stamps, s; none: read the recording without [default: `t_s` or `Enc TS`, if there is
    /// one]
    #[arg(long, value_name = "COLUMN|none")]
    time: Option<String>,
}

impl ColumnArguments {
    /// For reading the recording.
    pub fn map(&self) -> ColumnMap {
        let time = match self.time.as_deref() {
            Some("none") => TimeColumn::Ignored,
            Some(column) => TimeColumn::Named(column.to_owned()),
            None => TimeColumn::Known,
        };
        ColumnMap { time, counts: self.counts.clone(), outputs: self.angles.clone() }
    }
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(page) = &arguments.report {
        check_output("--report", page, &arguments.recording, arguments.overwrite)?;
    }
    let (mut recording, _) = Recording::read(&arguments.recording, &arguments.columns.map())?;
    if arguments.drift {
        (recording, _) = recording.without_latency();
    }
    let load = |file: &PathBuf| Ok((file.display().to_string(), load(file, &recording)?));
    let models = arguments.models.iter().map(load).collect::<Result<Vec<_>, Failure>>()?;
    if arguments.drift {
        return drift(arguments, &models, &recording);
    }
    let found = while_working("comparing", || Comparison::new(&models, &recording))?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&found)?);
    } else {
        print!("{found}");
    }
    Ok(())
}

/// Prints the drift of every model, and writes the page of the first.
fn drift(
    arguments: &Arguments,
    models: &[(String, Model)],
    recording: &Recording,
) -> Result<(), Failure> {
    let drift = |(name, model): &(String, Model)| {
        DriftReport::new(name, model, recording)
            .map_err(|error| format!("{name} on {}: {error}", recording.name()))
    };
    let found = models.iter().map(drift).collect::<Result<Vec<_>, _>>()?;
    if let (Some(page), Some(first)) = (&arguments.report, found.first()) {
        write(page, &first.html())?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&found)?);
        return Ok(());
    }
    for report in &found {
        println!("{report}  {}", report.verdict);
    }
    if let Some(page) = &arguments.report {
        println!("\nwrote {}", page.display());
    }
    Ok(())
}

fn load(file: &Path, recording: &Recording) -> Result<Model, Failure> {
    let model = Model::load(file)?;
    check(&model, recording).map_err(|reason| format!("model {}: {reason}", file.display()))?;
    Ok(model)
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
