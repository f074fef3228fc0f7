//! `i2ris calibrate`: from recordings to models.

mod collect;
mod columns;
mod compare;
mod fit;
mod guided;
mod merge;
mod refine;

pub use columns::ColumnArguments;
pub use fit::check_output;
use i2ris_report::Failure;

/// `i2ris calibrate`: a step by name, or the whole way.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  i2ris calibrate
  i2ris calibrate collect --config config/emulator.toml --home --output RECORDING.csv
  i2ris calibrate fit RECORDING.csv --output config/models/snake.json
  i2ris calibrate compare linear.json config/models/snake.json --recording unseen.csv
  i2ris calibrate refine TRIAL.mcap --model model.json --recording RECORDING.csv --output refined.json

Without a command it runs every step: collect, fit, compare, stage, activate, check. It says each
step, and goes on where it was."
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    guided: guided::Arguments,
}

impl Arguments {
    pub fn only_prints(&self) -> bool {
        self.command.as_ref().is_some_and(Command::only_prints)
    }
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Move the motors through a calibration protocol and record them with what a camera sees
    Collect(collect::Arguments),
    /// Compare models on a recording
    Compare(compare::Arguments),
    /// Fit a model to a recording of encoder counts and angles
    Fit(fit::Arguments),
    /// Put angles that were measured in pictures in the place of those of a recording
    Merge(merge::Arguments),
    /// Make a better model from a calibration and a recorded trial with a camera
    Refine(refine::Arguments),
}

impl Command {
    fn only_prints(&self) -> bool {
        !matches!(self, Self::Collect(_))
    }
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
        Command::Refine(arguments) => refine::run(&arguments),
    }
}
