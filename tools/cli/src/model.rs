//! `i2ris model`: models without a robot, and the models of a running controller.

mod activate;
mod csv_table;
mod drift;
mod invert;
mod list;
mod predict;
mod rollback;
mod show;
mod stage;

use std::path::{Path, PathBuf};

use i2ris::model::Model;
use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec, OutputVec};

use csv_table::CsvTable;
use i2ris_terminal::Failure;

/// What `i2ris model` can do.
#[derive(Debug, clap::Subcommand)]
#[command(after_help = "Examples:
  i2ris model show config/models/snake.json
  i2ris model stage config/models/newer.json && i2ris model activate
  i2ris model rollback
  i2ris model list --json")]
pub enum Command {
    /// Print a model for a person
    Show(show::Arguments),
    /// Angles in, encoder counts out: the control loop without a robot
    Invert(invert::Arguments),
    /// Encoder counts in, angles out
    Predict(predict::Arguments),
    /// Show the models that the running controller has loaded
    List(list::Arguments),
    /// Have the running controller check a model, compare it with the one in use, and keep it ready
    Stage(stage::Arguments),
    /// Let the staged model take over while the robot runs
    Activate(activate::Arguments),
    /// Let the model that was in use before take over again
    Rollback(rollback::Arguments),
}

/// Runs it.
pub fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Show(arguments) => show::run(&arguments),
        Command::Invert(arguments) => invert::run(&arguments),
        Command::Predict(arguments) => predict::run(&arguments),
        Command::List(arguments) => list::run(&arguments),
        Command::Stage(arguments) => stage::run(&arguments),
        Command::Activate(arguments) => activate::run(&arguments),
        Command::Rollback(arguments) => rollback::run(&arguments),
    }
}

/// The columns of a model's motors.
fn counts_columns(model: &Model) -> Vec<String> {
    (0..model.motors()).map(|motor| format!("q{motor}_counts")).collect()
}

/// The columns of a model's outputs.
fn output_columns(model: &Model) -> Vec<String> {
    let suffix = |output: &OutputSpec| match output.unit {
        OutputUnit::Deg => "deg",
        OutputUnit::Mm => "mm",
    };
    model
        .file()
        .outputs
        .iter()
        .map(|output| format!("{}_{}", output.name, suffix(output)))
        .collect()
}

/// The unit of a model's outputs, in radians or metres.
fn si(model: &Model) -> f64 {
    model.file().outputs.first().map_or(1.0, |output| output.unit.si())
}

/// The path of the motors before; empty without a file.
fn history(file: Option<&PathBuf>, model: &Model) -> Result<Vec<MotorVec>, Failure> {
    let Some(file) = file else {
        return Ok(Vec::new());
    };
    let table = CsvTable::read(file, &counts_columns(model))?;
    Ok(table.rows.iter().map(|row| motors(&row.values)).collect())
}

/// Values of a row as one per motor.
fn motors(values: &[f64]) -> MotorVec {
    let mut counts = [0.0; MAX_MOTORS];
    counts.iter_mut().zip(values).for_each(|(to, from)| *to = *from);
    counts
}

/// Values of a row, in the unit of the file, as one per output in radians or metres.
fn outputs(values: &[f64], si: f64) -> OutputVec {
    let mut outputs = [0.0; MAX_OUTPUTS];
    outputs.iter_mut().zip(values).for_each(|(to, from)| *to = from * si);
    outputs
}

/// Refuses to overwrite an input.
fn check_output(output: &Path, inputs: &[&Path]) -> Result<(), Failure> {
    let same = |input: &&Path| match (input.canonicalize(), output.canonicalize()) {
        (Ok(input), Ok(output)) => input == output,
        _ => false,
    };
    match inputs.iter().find(|input| same(input)) {
        Some(input) => {
            let (shown, input) = (output.display(), input.display());
            Err(format!("--output {shown}: is the same file as {input}; name another one").into())
        }
        None => Ok(()),
    }
}
