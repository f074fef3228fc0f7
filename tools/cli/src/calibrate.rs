//! `i2ris calibrate`.

use crate::Failure;

/// What `i2ris calibrate` can do.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Fit a model to a recording of encoder counts and angles
    Fit {},
}

/// Runs it.
pub fn run(_command: Command) -> Result<(), Failure> {
    Err("not built yet".into())
}
