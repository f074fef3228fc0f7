//! `i2ris calibrate`: from recordings to models.

mod fit;
mod progress;
mod report;

use crate::Failure;

/// What `i2ris calibrate` can do.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Fit a model to a recording of encoder counts and angles
    Fit(fit::Arguments),
}

/// Runs it.
pub fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Fit(arguments) => fit::run(&arguments),
    }
}
