//! `i2ris model`: models without a robot, and the models of a running controller.

mod columns;
mod import;
mod invert;
mod loaded;
mod predict;
mod show;

use i2ris_report::Failure;

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
    /// Make a model of a network that was trained elsewhere, and of a recording
    Import(import::Arguments),
    /// Show the models that the running controller has loaded
    List(loaded::ListArguments),
    /// Have the running controller check a model, compare it with the one in use, and keep it ready
    Stage(loaded::StageArguments),
    /// Let the staged model take over while the robot runs
    Activate(loaded::ActivateArguments),
    /// Let the model that was in use before take over again
    Rollback(loaded::RollbackArguments),
}

pub fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Show(arguments) => show::run(&arguments),
        Command::Invert(arguments) => invert::run(&arguments),
        Command::Predict(arguments) => predict::run(&arguments),
        Command::Import(arguments) => import::run(&arguments),
        Command::List(arguments) => loaded::list(&arguments),
        Command::Stage(arguments) => loaded::stage(&arguments),
        Command::Activate(arguments) => loaded::activate(&arguments),
        Command::Rollback(arguments) => loaded::roll_back(&arguments),
    }
}
