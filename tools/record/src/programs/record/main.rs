//! `i2ris record`: records trials as MCAP files, exports and recovers them.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod cameras;
mod existing;
mod export;
mod of_study;
mod recording;

use std::process::ExitCode;

use clap::Parser;
use i2ris_report::Failure;

/// Record trials, and make tables of recordings
#[derive(Debug, Parser)]
#[command(name = "i2ris-record", bin_name = "i2ris record", version, propagate_version = true)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Examples:
  i2ris record --output trial.mcap --note 'circle, 5 deg'
  i2ris record info trial.mcap
  i2ris record export trial.mcap --output tables
  i2ris record export trial.mcap --output parquet --format parquet
  i2ris record export reach-study --output reach --format parquet --pictures
  i2ris record extract trial.mcap --output parts
  i2ris record recover killed.mcap --output whole.mcap

Ctrl-C ends a recording. The file opens in Lichtblick, Foxglove, PlotJuggler, rosbags and
the Python package mcap: topics /measured_js, /setpoint_js and /goal_js as sensor_msgs/JointState,
topics /i2ris/... with every field of every stream.")]
struct Arguments {
    #[command(subcommand)]
    task: Option<Task>,
    #[command(flatten)]
    trial: recording::Arguments,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Make a complete file of one that was cut off: messages, metadata, attachments
    Recover(existing::RecoverArguments),
    /// Write recordings, or the trials of a study, as tables (CSV or Parquet)
    Export(export::Arguments),
    /// Take out what is attached (configuration, models, run log) and the commands of each client,
    /// for `i2ris command file`
    Extract(existing::ExtractArguments),
    /// Print the content of a recording
    Info(existing::InfoArguments),
}

fn main() -> ExitCode {
    i2ris_report::program::run(|arguments: &Arguments| arguments.task.is_some(), run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.task {
        None => recording::run(&arguments.trial),
        Some(Task::Recover(arguments)) => existing::copy(&arguments),
        Some(Task::Export(arguments)) => export::run(&arguments),
        Some(Task::Extract(arguments)) => existing::parts(&arguments),
        Some(Task::Info(arguments)) => existing::info(&arguments),
    }
}
