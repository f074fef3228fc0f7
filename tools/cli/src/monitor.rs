//! `i2ris monitor`.

use crate::Failure;

/// Arguments of `i2ris monitor`.
#[derive(Debug, clap::Args)]
pub struct Arguments {}

/// Runs it.
pub fn run(_arguments: Arguments) -> Result<(), Failure> {
    Err("not built yet".into())
}
