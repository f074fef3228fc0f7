//! `i2ris record`: records trials as MCAP files, exports, reports and recovers them; trials of
//! studies; the black box of a controller.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod existing;
mod export;
mod recording;
mod trial;

use std::process::ExitCode;

use clap::Parser;
use i2ris_report::Failure;

/// Record trials; report, export and replay them
#[derive(Debug, Parser)]
#[command(name = "i2ris-record", bin_name = "i2ris record", version, propagate_version = true)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Examples:
  i2ris record --output trial.mcap --note 'circle, 5 deg'
  i2ris record report trial.mcap
  i2ris record info trial.mcap --output parts
  i2ris record export trial.mcap --output tables
  i2ris record export reach-study --output reach --pictures
  i2ris record recover killed.mcap --output whole.mcap
  i2ris record trial start --study reach-study --participant P07 --condition joystick
  i2ris record replay                             save and replay the last seconds of the controller

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
    /// Repair a truncated recording: messages, metadata, attachments
    Recover(existing::RecoverArguments),
    /// Write recordings, or the trials of a study, as CSV tables
    Export(export::Arguments),
    /// List or extract the contents of a recording
    Info(existing::InfoArguments),
    /// Report on a recorded trial (tracking error, hysteresis, latencies, events), or on all trials
    /// of a study
    Report(existing::ReportArguments),
    /// Run the trials of a study: start, mark, stop, list
    #[command(subcommand)]
    Trial(trial::Task),
    /// Save the black box of the running controller (every tick of the last seconds), or take one
    /// of an earlier controller; replay it and compare bit for bit
    Replay(existing::ReplayArguments),
}

fn main() -> ExitCode {
    i2ris_report::program::run(|arguments: &Arguments| arguments.task.is_some(), run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.task {
        None => recording::run(&arguments.trial),
        Some(Task::Recover(arguments)) => existing::copy(&arguments),
        Some(Task::Export(arguments)) => export::run(&arguments),
        Some(Task::Info(arguments)) => existing::info(&arguments),
        Some(Task::Report(arguments)) => existing::report(&arguments),
        Some(Task::Trial(task)) => trial::run(task),
        Some(Task::Replay(arguments)) => existing::replay(&arguments),
    }
}
