//! The controller process.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::process::console_log::ConsoleLog;
use i2ris::process::{Failure, controller, read_command_line, run_process};

const HELP: &str = "\
Teleoperation controller for the I2RIS snake robot

Usage: i2ris-control --config FILE [--note TEXT]

Options:
  --config FILE  Configuration (TOML), for example config/emulator.toml
  --note TEXT    Operator's note about this run, for the run log
  --version      Print the version
  --help         Print this

SIGINT and SIGTERM decelerate, hold, and power the drives off cleanly; the exit code is then 0
if every drive confirmed power-off.

Exit codes:
  0  clean shutdown
  1  failed; the last line on standard error gives the reason
  2  invalid command line
  6  invalid configuration
  8  ended, but a drive did not confirm power-off: cut its power
";

fn main() -> ExitCode {
    run_process(start)
}

fn start(log: &mut ConsoleLog) -> Result<(), Failure> {
    let mut note = String::new();
    let config = read_command_line("i2ris-control", HELP, |option, parser| {
        let is_known = option == "note";
        if is_known {
            note = parser.value()?.to_string_lossy().into_owned();
        }
        Ok(is_known)
    })?;
    let Some(config) = config else { return Ok(()) };
    let shutdown = Arc::new(AtomicBool::new(false));
    let requested = Arc::clone(&shutdown);
    ctrlc::set_handler(move || requested.store(true, Ordering::Release))?;
    Ok(controller::run(&config, &note, &shutdown, log)?)
}
