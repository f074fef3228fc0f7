//! `i2ris doctor`: one line for each condition of a moving robot, with the fix.
//!
//! Nothing is changed: drives are read, not written; while a controller runs, not even read.

mod config;
mod devices;
pub mod drives;
mod system;
mod wire;

use std::fmt;
use std::path::{Path, PathBuf};

use i2ris::{config::Config, ipc::Domain, ipc::ready::Ready};
use i2ris_report::{Failure, programs::served_file};
use serde::Serialize;

use config::as_delivered;

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

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    match &arguments.other {
        Some(Other::Config(arguments)) => return config::run(arguments),
        Some(Other::Drives(arguments)) => return drives::run(arguments),
        Some(Other::Wire(arguments)) => return wire::run(arguments),
        None => {}
    }
    let mut report = Report::default();
    let file = arguments.config.clone().or_else(running).unwrap_or("config/emulator.toml".into());
    match Config::load_for_process(&file) {
        Ok(config) => {
            report.pass("configuration", file.display().to_string());
            for line in as_delivered(&std::fs::read_to_string(&file)?, &config) {
                report.warn("configuration", line, "go through the lines marked CHECK");
            }
            system::check(&config, &mut report);
            for port in &config.ports {
                drives::check_port(&config, port, !arguments.no_drives, &mut report);
            }
        }
        Err(error) => {
            report.fail("configuration", error, "correct the file, or name another with --config");
        }
    }
    devices::check_usb(Path::new("/sys"), &mut report);
    devices::check_input(&mut report);
    report.print(arguments.json)?;
    match report.failed().count() {
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

/// As expected; the robot works, but not as well as it could; the robot will not work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Level {
    Ok,
    Warn,
    Fail,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct Check {
    name: String,
    level: Level,
    found: String,
    fix: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Report {
    checks: Vec<Check>,
    found_tables: Vec<String>,
}

impl Report {
    pub fn pass(&mut self, name: impl ToString, found: impl ToString) {
        self.add(Level::Ok, name, found, "");
    }

    pub fn warn(&mut self, name: impl ToString, found: impl ToString, fix: impl ToString) {
        self.add(Level::Warn, name, found, fix);
    }

    pub fn fail(&mut self, name: impl ToString, found: impl ToString, fix: impl ToString) {
        self.add(Level::Fail, name, found, fix);
    }

    fn add(&mut self, level: Level, name: impl ToString, found: impl ToString, fix: impl ToString) {
        let [name, found, fix] = [name.to_string(), found.to_string(), fix.to_string()];
        self.checks.push(Check { name, level, found, fix });
    }

    pub fn paste(&mut self, table: String) {
        self.found_tables.push(table);
    }

    pub fn failed(&self) -> impl Iterator<Item = &str> {
        self.checks.iter().filter(|check| check.level == Level::Fail).map(|check| &*check.name)
    }

    /// First finding with its remedy, skipping those that contain `but`.
    #[cfg(test)]
    pub fn first(&self, but: &str) -> Option<[String; 2]> {
        let is_it = |check: &Check| !format!("{} {}", check.found, check.fix).contains(but);
        let of = |level| self.checks.iter().find(|it| it.level == level && is_it(it));
        let Check { name, found, fix, .. } = of(Level::Fail).or_else(|| of(Level::Warn))?;
        Some([format!("{name}: {found}"), fix.clone()])
    }

    pub fn print(&self, json: bool) -> Result<(), Failure> {
        match json {
            true => println!("{}", serde_json::to_string_pretty(self)?),
            false => print!("{self}"),
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.checks.iter().map(|check| check.name.chars().count()).max().unwrap_or(0);
        for Check { name, level, found, fix } in &self.checks {
            let mark = match level {
                Level::Ok => "ok  ",
                Level::Warn => "WARN",
                Level::Fail => "FAIL",
            };
            write!(f, "{mark}  {name:width$}  {found}")?;
            if !fix.is_empty() {
                write!(f, "\n      {:width$}  -> {fix}", "")?;
            }
            writeln!(f)?;
        }
        self.found_tables.iter().try_for_each(|table| {
            write!(f, "\nfound, to paste into the configuration in place of this port:\n\n{table}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_check_is_a_line_with_the_fix_below() {
        let mut report = Report::default();
        report.pass("memory", "locked");
        report.fail("port 0", "does not exist", "plug it in");
        assert_eq!(
            report.to_string(),
            "ok    memory  locked\nFAIL  port 0  does not exist\n              -> plug it in\n"
        );
        assert_eq!(report.failed().count(), 1);
        assert!(serde_json::to_string_pretty(&report).unwrap().contains("\"level\": \"fail\""));
    }
}
