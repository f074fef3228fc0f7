//! `i2ris doctor`: one line for each condition of a moving robot, with the fix.
//!
//! Nothing is changed: drives are read, not written. A running controller holds the ports, and the
//! drives cannot be read.

mod config;
mod devices;
pub mod drives;
pub mod ports;
pub mod report;
mod system;
mod usb;
mod wire;

use std::path::{Path, PathBuf};

use i2ris::config::Config;
use i2ris::ipc::Domain;
use i2ris::ipc::ready::Ready;

use config::as_delivered;
use i2ris_report::Failure;
use i2ris_report::programs::served_file;
use report::Report;

/// Arguments of `i2ris doctor`.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  i2ris doctor --config my-robot.toml
  i2ris doctor --config my-robot.toml --json --no-drives
  i2ris doctor config my-robot.toml              the file alone"
)]
pub struct Arguments {
    #[command(subcommand)]
    other: Option<Other>,
    /// The configuration of the controller [default: that of the controller running in the domain,
    /// or config/emulator.toml]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print JSON instead of lines
    #[arg(long)]
    json: bool,
    /// Do not open the serial ports: the drives are then not checked
    #[arg(long)]
    no_drives: bool,
}

#[derive(Debug, clap::Subcommand)]
enum Other {
    /// Check or print a configuration without starting anything
    Config(config::Arguments),
    /// Print or compare drive settings (read-only)
    Drives(drives::Arguments),
    /// Print requests and replies of a serial capture, and run them through the driver again; or
    /// compare two captures
    Wire(wire::Arguments),
}

/// Runs the checks. Fails when a check fails.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    match &arguments.other {
        Some(Other::Config(arguments)) => return config::run(arguments),
        Some(Other::Drives(arguments)) => return drives::run(arguments),
        Some(Other::Wire(arguments)) => return wire::run(arguments),
        None => {}
    }
    let mut report = Report::default();
    let file = arguments.config.clone().or_else(running);
    let file = file.unwrap_or_else(|| "config/emulator.toml".into());
    match Config::load_for_process(&file) {
        Ok(config) => {
            report.pass("configuration", file.display().to_string());
            let text = std::fs::read_to_string(&file)?;
            for line in as_delivered(&text, &config) {
                report.warn("configuration", line, "go through the lines marked CHECK");
            }
            system::check(&config, &mut report);
            for port in &config.ports {
                ports::check_port(&config, port, !arguments.no_drives, &mut report);
            }
        }
        Err(error) => report.fail(
            "configuration",
            error.to_string(),
            "correct the file, or name another with --config",
        ),
    }
    usb::check(Path::new("/sys"), &mut report);
    devices::check(&mut report);
    if arguments.json {
        println!("{}", report.to_json()?);
    } else {
        print!("{report}");
    }
    match report.failures() {
        0 => Ok(()),
        failures => Err(format!("{failures} checks failed").into()),
    }
}

/// The file that the controller of the domain was started with.
fn running() -> Option<PathBuf> {
    let name = std::env::var("I2RIS_DOMAIN");
    let domain = Domain::new(name.as_deref().unwrap_or("i2ris")).ok()?;
    served_file(Ready::read(&domain)?.pid)
}
