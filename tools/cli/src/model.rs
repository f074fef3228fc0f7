//! `i2ris model`: models without a robot, and the models of a running controller.

mod convert;
mod loaded;
mod show;

use std::path::{Path, PathBuf};

use i2ris::model::Model;
use i2ris_calibration::recording::{ColumnMap, Row, Wanted, column_of};
use i2ris_report::{Failure, bail, files::same};

use crate::csv_table;
pub use show::show;

#[derive(Debug, clap::Subcommand)]
#[command(after_help = "Examples:
  i2ris model use config/models/newer.json --enable
  i2ris model back
  i2ris model show                               the models of the running controller
  i2ris model show config/models/snake.json")]
pub enum Command {
    /// Check, activate and condition a model
    Use(loaded::UseArguments),
    /// Return to the previous model
    Back(loaded::BackArguments),
    /// Print a model file, or the loaded models
    Show(show::Arguments),
    /// Convert angles to counts
    Invert(convert::InvertArguments),
    /// Convert counts to angles
    Predict(convert::PredictArguments),
}

impl Command {
    pub fn only_prints(&self) -> bool {
        !matches!(self, Self::Use(_) | Self::Back(_))
    }
}

pub fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Use(arguments) => loaded::take_into_use(&arguments),
        Command::Back(arguments) => loaded::back(&arguments),
        Command::Show(arguments) => show::run(&arguments),
        Command::Invert(arguments) => convert::invert(&arguments),
        Command::Predict(arguments) => convert::predict(&arguments),
    }
}

pub fn counts_columns(model: &Model) -> Vec<String> {
    (0..model.motors()).map(|motor| format!("q{motor}_counts")).collect()
}

pub fn output_columns(model: &Model) -> Vec<String> {
    model.file().outputs.iter().map(column_of).collect()
}

/// The unit of a model's outputs, in radians or metres.
pub fn si(model: &Model) -> f64 {
    model.file().outputs.first().map_or(1.0, |output| output.unit.si())
}

pub fn history(
    file: Option<&PathBuf>,
    columns: &ColumnMap,
    model: &Model,
) -> Result<Vec<Row>, Failure> {
    let Some(file) = file else { return Ok(Vec::new()) };
    Ok(csv_table::read(file, columns, &Wanted::path_of(model.motors()))?.rows)
}

pub fn check_output(output: &Path, inputs: &[&Path]) -> Result<(), Failure> {
    if let Some(input) = inputs.iter().find(|input| same(input, output)) {
        let (shown, input) = (output.display(), input.display());
        bail!("--output {shown}: is the same file as {input}; name another file");
    }
    Ok(())
}
