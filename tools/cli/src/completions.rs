//! `i2ris completions`: a shell script that completes commands and options.

use std::io::{Write, stdout};

use clap_complete::{Shell, generate};
use i2ris_report::{Failure, until_closed};

use crate::external;

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

/// Prints the script for `own`, the command line of `i2ris`, and its programs.
pub fn run(arguments: &Arguments, own: clap::Command) -> Result<(), Failure> {
    let mut command = external::with_descriptions(own);
    let mut script = Vec::new();
    generate(arguments.shell, &mut command, "i2ris", &mut script);
    until_closed(stdout().write_all(&script))?;
    Ok(())
}
