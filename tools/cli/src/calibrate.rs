//! `i2ris calibrate`: from recordings to models.

mod collect;
mod compare;
mod drift;
mod fit;
mod fit_report;
mod merge;
mod progress_bar;
mod update;
mod zoo;

use i2ris_terminal::Failure;

/// What `i2ris calibrate` can do.
#[derive(Debug, clap::Subcommand)]
#[command(after_help = "Examples:
  i2ris calibrate collect --config config/emulator.toml --home --output RECORDING.csv
  i2ris calibrate fit RECORDING.csv --output config/models/snake.json
  i2ris calibrate compare linear.json config/models/snake.json --recording unseen.csv
  i2ris calibrate update minute.csv --model config/models/snake.json --output today.json")]
pub enum Command {
    /// Move the motors through a calibration protocol and record them with what a camera sees
    Collect(collect::Arguments),
    /// Compare models on a recording
    Compare(compare::Arguments),
    /// Fit a model to a recording of encoder counts and angles
    Fit(fit::Arguments),
    /// Put angles that were measured in pictures in the place of those of a recording
    Merge(merge::Arguments),
    /// Make a new model from an old one and a minute of motion
    Update(update::Arguments),
    /// Judge the fit on emulated snakes of many physics, in simulated time
    Zoo(zoo::Arguments),
}

impl Command {
    /// Whether it moves nothing.
    pub fn only_prints(&self) -> bool {
        !matches!(self, Self::Collect(_))
    }
}

/// Runs it.
pub fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Collect(arguments) => collect::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Fit(arguments) => fit::run(&arguments),
        Command::Merge(arguments) => merge::run(&arguments),
        Command::Update(arguments) => update::run(&arguments),
        Command::Zoo(arguments) => zoo::run(&arguments),
    }
}
