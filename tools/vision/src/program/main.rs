//! `i2ris vision`: from microscope images to angles.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod calibrate;
mod hand_on;
mod input;
mod measure;
mod render;
mod report;

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
  i2ris vision --setup vision.toml P/top P/side --rest-s 0 --overlays drawn
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
    /// Find which view shows which axis, and the straight pose, and write them into a setup
    Calibrate(calibrate::Arguments),
    /// Draw synthetic images of given angles
    Render(render::Arguments),
}

fn main() -> ExitCode {
    i2ris_report::program::run(|_| true, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.task {
        None => measure::run(arguments.measure),
        Some(Task::Calibrate(arguments)) => calibrate::run(&arguments),
        Some(Task::Render(arguments)) => render::run(&arguments),
    }
}
