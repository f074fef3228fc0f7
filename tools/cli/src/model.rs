//! `i2ris model`: models without a robot, and the models of a running controller.

mod columns;
mod invert;
mod loaded;
mod predict;
mod show;

pub use show::show;

use i2ris_report::Failure;

/// Commands of `i2ris model`.
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
    Invert(invert::Arguments),
    /// Convert counts to angles
    Predict(predict::Arguments),
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
        Command::Invert(arguments) => invert::run(&arguments),
        Command::Predict(arguments) => predict::run(&arguments),
    }
}
