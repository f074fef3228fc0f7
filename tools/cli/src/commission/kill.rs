//! Kills a controller while it holds the drives, and checks that the watchdog stops them.

use std::fs;
use std::path::Path;
use std::process::Command;

use i2ris::clock;
use i2ris::config::{Config, HomingMethod};
use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, StateCommand};
use i2ris::units::Nanos;
use i2ris_report::process::Process;
use i2ris_report::programs::find;
use i2ris_report::{Failure, Interrupt, files};

use crate::start::wait;

/// Holding time of the controller before it is killed.
const HOLDS: Nanos = Nanos::from_millis(2000);

/// Starts both, enables the drives, and kills the controller. Returns the watchdog's log of it.
///
/// Nothing moves: regardless of the configured homing, the present pose becomes the zero.
pub fn kill_controller(
    config: &Config,
    folder: &Path,
    interrupt: &Interrupt,
) -> Result<String, Failure> {
    let mut config = config.clone();
    let axes = config.ports.iter_mut().flat_map(|port| &mut port.axes);
    axes.for_each(|axis| axis.homing = HomingMethod::Here);
    let file = folder.join("kill.toml");
    files::write(&file, toml::to_string(&config)?)?;
    let domain = Domain::new(&config.domain)?;
    let start = |name: &'static str| -> Result<Process, Failure> {
        let program = find(name).ok_or(format!("program i2ris-{name} not found"))?;
        let mut command = Command::new(program);
        command.env("I2RIS_DOMAIN", domain.name());
        let _ = fs::remove_file(folder.join(format!("{name}.log")));
        Process::start(name, command.arg("--config").arg(&file), folder)
    };
    let log = folder.join("watchdog.log");
    let has_logged = |word: &str| fs::read_to_string(&log).is_ok_and(|text| text.contains(word));
    let mut watchdog = start("watchdog")?;
    let mut controller = start("control")?;
    let both = &mut [&mut watchdog, &mut controller];
    wait(interrupt, both, "the controller", || Client::connect(&domain, Nanos::ZERO).is_ok())?;
    wait(interrupt, both, "the watchdog", || has_logged("watching the controller"))?;
    let mut client = Client::connect(&domain, HOLDS)?;
    client.carry_out(StateCommand::Home, || interrupt.came())?;
    client.carry_out(StateCommand::Enable, || interrupt.came())?;
    clock::sleep(HOLDS);
    controller.kill()?;
    let lines = config.axes().count();
    let stopped =
        || fs::read_to_string(&log).is_ok_and(|text| text.matches(", motor ").count() >= lines);
    wait(interrupt, &mut [&mut watchdog], "the stop by the watchdog", stopped)?;
    let text = fs::read_to_string(&log)?;
    let after = text.lines().skip_while(|line| !line.contains("last heartbeat"));
    let lines: Vec<&str> = after.collect();
    watchdog.end()?;
    Ok(format!("log of the watchdog: {}", lines.join(" | ")))
}
