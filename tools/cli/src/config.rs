//! `i2ris config`: looking at a configuration without starting anything.

mod describe;
mod schema;

use std::path::PathBuf;

use i2ris::config::Config;

use i2ris_report::Failure;
use schema::Kind;

/// What `i2ris config` can do.
#[derive(Debug, clap::Subcommand)]
#[command(after_help = "Examples:
  i2ris config check my-robot.toml
  i2ris config print config/robot.toml           every key with its meaning and its value
  i2ris config schema > robot.schema.json        for editors: completion, meanings, unknown keys
  i2ris config schema vision                     of the file that describes the views")]
pub enum Command {
    /// Say whether a configuration is valid, or what is wrong with it and where
    Check {
        /// The configuration
        file: PathBuf,
        /// As JSON
        #[arg(long)]
        json: bool,
    },
    /// Print a configuration with every key and what it means, those that the file leaves out with
    /// their defaults
    Print {
        /// The configuration
        file: PathBuf,
        /// As JSON, without meanings
        #[arg(long)]
        json: bool,
    },
    /// Print a JSON Schema: every key, its type, what it means
    Schema {
        /// Of which kind of file
        #[arg(value_enum, default_value_t = Kind::Controller)]
        kind: Kind,
    },
}

pub fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Check { file, json } => check(file.clone(), *json)?,
        Command::Print { file, json: true } => {
            println!("{}", serde_json::to_string_pretty(&Config::load(file)?)?)
        }
        Command::Print { file, json: false } => {
            print!("{}", describe::describe(&Config::load(file)?)?)
        }
        Command::Schema { kind } => {
            print!("{}", schema::text(*kind))
        }
    }
    Ok(())
}

fn check(file: PathBuf, json: bool) -> Result<(), Failure> {
    let config = Config::load_and_check_files(&file)?;
    let (robot, motors) = (&config.robot_id, config.motors());
    if json {
        println!(
            "{}",
            serde_json::json!({ "file": file, "valid": true, "robot_id": robot, "motors": motors })
        );
    } else {
        println!("{}: valid; robot {robot}, {motors} motor(s)", file.display());
        if let Some(delay_s) = config.command.tremor_filter_delay_s() {
            println!(
                "the tremor filter of {} Hz delays the goal by {:.0} ms",
                config.command.tremor_filter_hz,
                delay_s * 1e3
            );
        }
    }
    Ok(())
}
