//! `i2ris preflight`: go/no-go check before each trial.

mod facts;
mod judgement;
mod motion;
mod swing;
#[cfg(test)]
pub mod tests;

use std::path::PathBuf;

use i2ris::clock;
use i2ris::config::Config;
use i2ris_report::preflight::Preflight;
use i2ris_report::programs::served_file;
use i2ris_report::{DomainOption, Failure, Interrupt, bail};

use crate::command::prepare::{PrepareOptions, connect};
use judgement::judge;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris preflight                    asks before the snake moves
  i2ris preflight --enable --json    in a script: permit enabling and motion

Checks drives, model, zero, lines, camera, clock, disk and watchdog, and swings the snake by less
than 2 deg to one side, in pitch and then in yaw, for half a minute. The next `i2ris record trial
start` stores the result, and warns if there was no check in the last hour. On Ctrl-C the robot
stops and holds.")]
pub struct Arguments {
    /// The configuration of the controller [default: the one it was started with]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print JSON instead of lines
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    prepare: PrepareOptions,
    #[command(flatten)]
    domain: DomainOption,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let domain = arguments.domain.domain()?;
    let mut client = connect(&domain)?;
    let version = client.version()?;
    let file = arguments.config.clone().or_else(|| served_file(version.pid));
    let file = file.ok_or("the configuration of this controller cannot be found; use --config")?;
    let config = Config::load(&file)?;
    let mut measured = facts::gather(&client, &domain, &config, &version)?;
    let swing = swing::run(&mut client, arguments.prepare, &measured, &interrupt);
    if interrupt.came() {
        bail!("interrupted; the robot holds");
    }
    measured.swing = swing?;
    let report = judge(&measured);
    report.print(arguments.json)?;
    let no_go: Vec<String> = report.failed().map(str::to_owned).collect();
    let outcome = if no_go.is_empty() { Ok(()) } else { Err(no_go.join(", ")) };
    let (time, stamp_ns) = (i2ris::wall_clock::now().to_string(), clock::now().0);
    Preflight { time, stamp_ns, boot_id: version.boot_id, no_go }.write(&domain)?;
    outcome.map_err(|named| format!("no-go: {named}"))?;
    if !arguments.json {
        println!("go");
    }
    Ok(())
}
