//! `i2ris completions`: a shell script that completes commands and options.

use std::io::{Write, stdout};

use clap::CommandFactory;
use clap_complete::{Shell, generate};
use i2ris_terminal::{Failure, until_closed};

use crate::{Cli, external};

/// Arguments of `i2ris completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris completions bash > ~/.local/share/bash-completion/completions/i2ris

The script completes i2ris and those of its programs (i2ris-record, i2ris-monitor, ...) that are \
installed when it is written.")]
pub struct Arguments {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut command = external::with_descriptions(Cli::command());
    let mut script = Vec::new();
    generate(arguments.shell, &mut command, "i2ris", &mut script);
    until_closed(stdout().write_all(&script))?;
    Ok(())
}
