//! `i2ris calibrate compare`: model files side by side on one recording.

use std::path::PathBuf;

use i2ris::model::Model;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_calibration::report::{Comparison, DriftReport};
use i2ris_report::{Failure, while_working};

use super::{ColumnArguments, check, check_output, without_latency, write};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris calibrate compare linear.json gmr.json force-balance.json --recording unseen.csv
  i2ris calibrate compare config/models/snake.json --recording today.csv --drift --report drift.html

The memory of every model follows the path of the motors through the whole recording, from an
unknown start. Compare on a recording that none of the models was fitted to. Stamps are used as
recorded; with --drift, a latency of the camera that held-out rows confirm is subtracted.")]
pub struct Arguments {
    /// The models
    #[arg(required = true)]
    models: Vec<PathBuf>,
    /// The recording: a CSV file with encoder counts and measured angles
    #[arg(long, value_name = "FILE")]
    recording: PathBuf,
    /// Drift of the robot from each calibration: zero, gain and gaps, with their uncertainty, and
    /// whether to recalibrate
    #[arg(long)]
    drift: bool,
    /// Page to write, with figures of the drift from the first model
    #[arg(long, value_name = "FILE.html", requires = "drift")]
    report: Option<PathBuf>,
    /// Overwrite the page if it exists
    #[arg(long, requires = "report")]
    overwrite: bool,
    /// Print the table as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    columns: ColumnArguments,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(page) = &arguments.report {
        check_output("--report", page, &arguments.recording, arguments.overwrite)?;
    }
    let columns = ColumnMap { still: true, ..arguments.columns.map() };
    let (mut recording, read) = Recording::read(&arguments.recording, &columns)?;
    read.notes.iter().for_each(|note| eprintln!("warning: {}: {note}", recording.name()));
    if arguments.drift {
        (recording, _) = without_latency(recording);
    }
    let load = |file: &PathBuf| {
        let (model, name) = (Model::load(file)?, file.display().to_string());
        check(&model, &recording).map_err(|reason| format!("model {name}: {reason}"))?;
        Ok((name, model))
    };
    let models = arguments.models.iter().map(load).collect::<Result<Vec<_>, Failure>>()?;
    if arguments.drift {
        return drift(arguments, &models, &recording);
    }
    let found = while_working("comparing", || Comparison::new(&models, &recording))?;
    match arguments.json {
        true => println!("{}", serde_json::to_string_pretty(&found)?),
        false => print!("{found}"),
    }
    Ok(())
}

fn drift(
    arguments: &Arguments,
    models: &[(String, Model)],
    recording: &Recording,
) -> Result<(), Failure> {
    let on = recording.name();
    let drift = |(name, model): &(String, Model)| {
        DriftReport::new(name, model, recording).map_err(|error| format!("{name} on {on}: {error}"))
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
    arguments.report.iter().for_each(|page| println!("\nwrote {}", page.display()));
    Ok(())
}
