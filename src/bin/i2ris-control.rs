//! The controller process.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::COMMIT;
use i2ris::config::{Config, ConfigError};
use i2ris::process::console_log::ConsoleLog;
use i2ris::process::controller::{self, ControllerError};
use lexopt::Arg::{Long, Short};

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

enum Request {
    Help,
    Version,
    Run(PathBuf, String),
}

type Failure = Box<dyn std::error::Error>;

fn main() -> ExitCode {
    i2ris::process::run_process(start, code)
}

/// The same codes as those of `i2ris`.
fn code(failure: &Failure) -> u8 {
    if failure.is::<UsageError>() {
        2
    } else if failure.is::<ConfigError>() {
        6
    } else if matches!(failure.downcast_ref(), Some(ControllerError::Powered { .. })) {
        8
    } else {
        1
    }
}

#[derive(Debug, thiserror::Error)]
#[error("{0}; see i2ris-control --help")]
struct UsageError(lexopt::Error);

fn start(log: &mut ConsoleLog) -> Result<(), Failure> {
    let request = parse(std::env::args_os().skip(1)).map_err(UsageError)?;
    match request {
        Request::Help => print(HELP),
        Request::Version => {
            print(&format!("i2ris-control {} ({COMMIT})\n", env!("CARGO_PKG_VERSION")))
        }
        Request::Run(path, note) => {
            let config = Config::load_for_process(&path)?;
            let shutdown = Arc::new(AtomicBool::new(false));
            let requested = Arc::clone(&shutdown);
            ctrlc::set_handler(move || requested.store(true, Ordering::Release))?;
            Ok(controller::run(&config, &note, &shutdown, log)?)
        }
    }
}

fn print(text: &str) -> Result<(), Failure> {
    Ok(io::stdout().write_all(text.as_bytes())?)
}

fn parse(arguments: impl IntoIterator<Item = OsString>) -> Result<Request, lexopt::Error> {
    let mut parser = lexopt::Parser::from_args(arguments);
    let (mut config, mut note) = (None, String::new());
    while let Some(argument) = parser.next()? {
        match argument {
            Short('h') | Long("help") => return Ok(Request::Help),
            Short('V') | Long("version") => return Ok(Request::Version),
            Short('c') | Long("config") => config = Some(PathBuf::from(parser.value()?)),
            Long("note") => note = parser.value()?.to_string_lossy().into_owned(),
            other => return Err(other.unexpected()),
        }
    }
    let config = config.ok_or("no configuration: use --config FILE")?;
    Ok(Request::Run(config, note))
}
