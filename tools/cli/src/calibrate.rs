//! `i2ris calibrate`: recordings and models.

mod collect;
mod compare;
mod files;
mod fit;
mod guided;
mod merge;
mod refine;

use i2ris_report::Failure;

pub use files::{ColumnArguments, PathColumns};

/// `i2ris calibrate`: one step, or all of them.
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
    let Some(command) = arguments.command else {
        return guided::run(&arguments.guided);
    };
    match command {
        Command::Collect(arguments) => collect::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Fit(arguments) => fit::run(&arguments),
        Command::Merge(arguments) => merge::run(&arguments),
    }
}
