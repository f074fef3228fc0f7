//! `i2ris config`: looking at a configuration without starting anything.

use std::path::PathBuf;

use i2ris::config::Config;

use crate::Failure;

/// What `i2ris config` can do.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Say whether a configuration is valid, or what is wrong with it and where
    Check {
        /// The configuration
        file: PathBuf,
    },
    /// Print a configuration with every key, those that the file leaves out with their defaults
    Print {
        /// The configuration
        file: PathBuf,
        /// As JSON
        #[arg(long)]
        json: bool,
    },
}

/// Runs it.
pub fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Check { file } => {
            let config = Config::load(file)?;
            println!("{}: valid; robot {}, {} motor(s)", file.display(), config.robot_id, config.motors());
        }
        Command::Print { file, json: true } => println!("{}", serde_json::to_string_pretty(&Config::load(file)?)?),
        Command::Print { file, json: false } => print!("{}", toml::to_string(&Config::load(file)?)?),
    }
    Ok(())
}
