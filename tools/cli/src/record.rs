//! `i2ris record`: trials as MCAP files, and what can be done with them afterwards.

mod after;
mod audit;
mod ears;
mod trial;

use crate::Failure;

/// Arguments of `i2ris record`.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Examples:
  i2ris record --output trial.mcap --config config/emulator.toml --note 'circle, 5 deg'
  i2ris record info trial.mcap
  i2ris record export trial.mcap --output tables
  i2ris record export trial.mcap --output tables --format parquet
  i2ris record recover killed.mcap --output whole.mcap

Ctrl-C ends a recording. The file opens in Lichtblick, Foxglove, PlotJuggler, rosbags and the Python package mcap: topics
/measured_js, /setpoint_js and /goal_js as sensor_msgs/JointState, topics /i2ris/... with every field of every stream.")]
pub struct Arguments {
    #[command(subcommand)]
    task: Option<Task>,
    #[command(flatten)]
    trial: trial::Arguments,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Make a whole file of one that was cut off: messages, metadata, attachments
    Recover(after::RecoverArguments),
    /// Write every topic as a table: CSV or Parquet
    Export(after::ExportArguments),
    /// Tell what a recording holds
    Info(after::InfoArguments),
}

impl Arguments {
    /// Whether it records nothing.
    pub fn only_prints(&self) -> bool {
        self.task.is_some()
    }
}

/// Runs it.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.task {
        None => trial::run(&arguments.trial),
        Some(Task::Recover(arguments)) => after::recover(&arguments),
        Some(Task::Export(arguments)) => after::export(&arguments),
        Some(Task::Info(arguments)) => after::info(&arguments),
    }
}
