//! `i2ris record`: trials as MCAP files, and what can be done with them afterwards.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command-line program prints"
)]

mod after;
mod audit;
mod ears;
mod trial;

use clap::Parser;
use i2ris_terminal::Failure;
use std::process::ExitCode;

/// Record trials, and make tables of recordings
#[derive(Debug, Parser)]
#[command(
    name = "i2ris-record",
    bin_name = "i2ris record",
    version,
    propagate_version = true
)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Examples:
  i2ris record --output trial.mcap --config config/emulator.toml --note 'circle, 5 deg'
  i2ris record info trial.mcap
  i2ris record export trial.mcap --output tables
  i2ris record export trial.mcap --output tables --format parquet
  i2ris record recover killed.mcap --output whole.mcap

Ctrl-C ends a recording. The file opens in Lichtblick, Foxglove, PlotJuggler, rosbags and the Python package mcap: topics
/measured_js, /setpoint_js and /goal_js as sensor_msgs/JointState, topics /i2ris/... with every field of every stream.")]
struct Arguments {
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

fn main() -> ExitCode {
    i2ris_terminal::program::run(|arguments: &Arguments| arguments.task.is_some(), run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.task {
        None => trial::run(&arguments.trial),
        Some(Task::Recover(arguments)) => after::recover(&arguments),
        Some(Task::Export(arguments)) => after::export(&arguments),
        Some(Task::Info(arguments)) => after::info(&arguments),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_help_has_an_example_and_the_command_line_is_consistent() {
        let mut command = Arguments::command();
        let help = command.render_long_help().to_string();
        assert!(
            help.contains("Example") && help.contains("i2ris record"),
            "{help}"
        );
        command.debug_assert();
    }
}
