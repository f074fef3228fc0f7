//! `i2ris calibrate update`: a new model from an old one and a minute of motion.

use std::path::PathBuf;

use i2ris::model::Model;
use i2ris_calibration::drift::{Verdict, update};
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_calibration::report::DriftReport;
use i2ris_report::{Failure, while_working};

use super::compare::check;
use super::fit::{check_output, write};

/// Arguments of `i2ris calibrate update`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris calibrate update minute.csv --model config/models/snake.json --output today.json

The shape of the old model stays; zero, gain and scale of the gaps are found anew, with the old
ones as prior: what the motion does not show stays as it was. Three quarters of the recording have
to make a model that is better on the last quarter, or nothing is written. A minute of motion that
reverses both motors many times is enough.")]
pub struct Arguments {
    /// The recording: a CSV file with encoder counts and measured angles
    recording: PathBuf,
    /// The old model
    #[arg(long, value_name = "MODEL.json")]
    model: PathBuf,
    /// Where to write the new model; its folder is made
    #[arg(long, short, value_name = "MODEL.json")]
    output: PathBuf,
    /// Where to write a page with figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Replace the files, if they exist
    #[arg(long)]
    overwrite: bool,
}

/// Runs it. The model is written when all else has succeeded.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { recording: file, output, overwrite, .. } = arguments;
    check_output("--output", output, file, *overwrite)?;
    if let Some(page) = &arguments.report {
        check_output("--report", page, file, *overwrite)?;
    }
    let old = Model::load(&arguments.model)?;
    let (recording, _) = Recording::read(file, &ColumnMap::default())?;
    let (recording, latency) = recording.without_latency();
    let name = arguments.model.display().to_string();
    check(&old, &recording).map_err(|reason| format!("model {name}: {reason}"))?;
    let updated = while_working("updating", || update(&old, &recording))
        .map_err(|error| format!("recording {}: {error}", file.display()))?;
    let drift = DriftReport::of(&name, &old, updated.drift, &recording);
    if let Some(page) = &arguments.report {
        write(page, &drift.html())?;
    }
    updated.model.file().write(output)?;
    print!("{drift}");
    let [before, after] = updated.held_out;
    println!("  held out   {before:.3} before, {after:.3} after");
    if let Some(seconds) = latency {
        println!("  latency    {:+.1} ms were taken off the stamps of the angles", 1e3 * seconds);
    }
    if drift.verdict == Verdict::Calibrate {
        println!("  {}: this is more than a drift", drift.verdict);
    }
    println!("\nwrote {}", output.display());
    if let Some(page) = &arguments.report {
        println!("wrote {}", page.display());
    }
    Ok(())
}
