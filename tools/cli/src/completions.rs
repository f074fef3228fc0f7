//! `i2ris completions`: what a shell needs to complete commands and options.

use std::io::{Write, stdout};

use clap::CommandFactory;
use clap_complete::{Shell, generate};

use crate::console::until_closed;
use crate::{Cli, Failure};

/// Arguments of `i2ris completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris completions bash > ~/.local/share/bash-completion/completions/i2ris")]
pub struct Arguments {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut script = Vec::new();
    generate(arguments.shell, &mut Cli::command(), "i2ris", &mut script);
    until_closed(stdout().write_all(&script))?;
    Ok(())
}
