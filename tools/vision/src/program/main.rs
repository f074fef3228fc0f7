//! `i2ris vision`: from microscope images to angles.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod accuracy;
mod calibrate;
mod check;
mod hand_on;
mod input;
mod measure;
mod render;
mod report;
mod scale;

use clap::Parser;
use i2ris_report::Failure;
use std::process::ExitCode;

/// Measure angles in microscope images
#[derive(Debug, Parser)]
#[command(name = "i2ris-vision", bin_name = "i2ris vision", version, propagate_version = true)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Examples:
  i2ris vision calibrate --setup my.toml --pitch P/top P/side --yaw Y/top Y/side \\
      --output vision.toml
  i2ris vision check --setup vision.toml --sheet sheet.png P/top P/side
  i2ris vision --setup vision.toml top.fifo side.fifo --latency-ms 40 --publish \\
      --output angles.csv")]
struct Arguments {
    #[command(subcommand)]
    task: Option<Task>,
    #[command(flatten)]
    measure: measure::Arguments,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Draw the measurements over the images
    Check(check::Arguments),
    /// Find which view shows which axis, and the straight pose, and write them into a setup
    Calibrate(calibrate::Arguments),
    /// Find the scale from two images between which a stage moved by a known distance
    Scale(scale::Arguments),
    /// Draw synthetic images of given angles
    Render(render::Arguments),
    /// Measure how exact the detector is on synthetic images
    Accuracy(accuracy::Arguments),
}

fn main() -> ExitCode {
    i2ris_report::program::run(|_| true, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.task {
        None => measure::run(arguments.measure),
        Some(Task::Check(arguments)) => check::run(&arguments),
        Some(Task::Calibrate(arguments)) => calibrate::run(&arguments),
        Some(Task::Scale(arguments)) => scale::run(&arguments),
        Some(Task::Render(arguments)) => render::run(&arguments),
        Some(Task::Accuracy(arguments)) => accuracy::run(&arguments),
    }
}
