//! `i2ris calibrate`: from recordings to models.

mod collect;
mod compare;
mod fit;
mod merge;
mod progress;
mod report;

use crate::Failure;

/// What `i2ris calibrate` can do.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Move the motors through a calibration protocol and record them with what a camera sees
    Collect(collect::Arguments),
    /// Compare models on a recording
    Compare(compare::Arguments),
    /// Fit a model to a recording of encoder counts and angles
    Fit(fit::Arguments),
    /// Put angles that were measured in pictures in the place of those of a recording
    Merge(merge::Arguments),
}

/// Runs it.
pub fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Collect(arguments) => collect::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Fit(arguments) => fit::run(&arguments),
        Command::Merge(arguments) => merge::run(&arguments),
    }
}
