//! `i2ris vision`: measures angles in microscope images.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod input;
mod measure;
mod picture_forwarding;

use std::process::ExitCode;

fn main() -> ExitCode {
    i2ris_report::program::run(|_| true, measure::run)
}
