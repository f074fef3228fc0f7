//! `i2ris vision`: measures angles in microscope images.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod input;
mod measure;
mod picture_forwarding;

use clap::Parser;
use std::process::ExitCode;

/// Measure angles in microscope images
#[derive(Debug, Parser)]
#[command(name = "i2ris-vision", bin_name = "i2ris vision", version)]
#[command(after_help = "Examples:
  i2ris vision --setup vision.toml P/top P/side --overlays drawn
  i2ris vision --setup vision.toml top.fifo side.fifo --latency-ms 40 --publish \\
      --output angles.csv")]
struct Arguments {
    #[command(flatten)]
    measure: measure::Arguments,
}

fn main() -> ExitCode {
    i2ris_report::program::run(|_| true, |Arguments { measure }| measure::run(measure))
}
