//! The watchdog process: stops the drives when the controller dies or hangs.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::config::{Config, ConfigError};
use i2ris::ipc::Domain;
use i2ris::ipc::watchdog_presence::WatchdogPresence;
use i2ris::process::console_log::ConsoleLog;
use i2ris::realtime::{self, SchedulingRequest};
use i2ris::service_manager;
use i2ris::units::Nanos;
use i2ris::watchdog::{self, Watched};
use i2ris::{COMMIT, clock};
use lexopt::Arg::{Long, Short};
use lexopt::ValueExt;

const HELP: &str = "\
Stops the drives of the I2RIS snake robot when its controller dies or hangs

Usage: i2ris-watchdog --config FILE [--silence-ms N]

Options:
  --config FILE    Configuration of the controller
  --silence-ms N   Age of the last heartbeat at which quick stop is sent, 50 to 10000 [default: 50]
  --version        Print the version
  --help           Print this

It keeps every port open that the controller uses. While it runs, the controller refuses to enable
if it lacks a port, or if its configuration has different ports or axes. SIGINT and SIGTERM end it
without stopping the drives. It cannot act when the host loses power or hangs as a whole, or when a
cable is pulled: then its pulse ends ([watchdog] of the configuration) and a relay on the
safe-torque-off inputs of the drives opens. On a terminal it ends after 10 s without any port; as a
service it waits.

Exit codes, as those of i2ris-control:
  0  ended by SIGINT or SIGTERM
  1  failed; the last line on standard error gives the reason
  2  invalid command line
  6  invalid configuration
";

/// SCHED_FIFO priority: above every thread of the controller.
const PRIORITY: u8 = 90;

type Failure = Box<dyn std::error::Error>;

enum Request {
    Help,
    Version,
    Run(PathBuf, Nanos),
}

fn main() -> ExitCode {
    i2ris::process::run_process(start, code)
}

fn code(failure: &Failure) -> u8 {
    if failure.is::<UsageError>() {
        2
    } else if failure.is::<ConfigError>() {
        6
    } else {
        1
    }
}

#[derive(Debug, thiserror::Error)]
#[error("{0}; see i2ris-watchdog --help")]
struct UsageError(lexopt::Error);

fn start(log: &mut ConsoleLog) -> Result<(), Failure> {
    let request = parse(std::env::args_os().skip(1)).map_err(UsageError)?;
    match request {
        Request::Help => Ok(io::stdout().write_all(HELP.as_bytes())?),
        Request::Version => {
            Ok(writeln!(io::stdout(), "i2ris-watchdog {} ({COMMIT})", env!("CARGO_PKG_VERSION"))?)
        }
        Request::Run(path, silence) => {
            let config = Config::load_for_process(&path)?;
            let domain = Domain::new(&config.domain)?;
            let presence = WatchdogPresence::announce(&domain, &config.ports_digest())?;
            let stop = Arc::new(AtomicBool::new(false));
            let requested = Arc::clone(&stop);
            ctrlc::set_handler(move || requested.store(true, Ordering::Release))?;
            let wanted = SchedulingRequest {
                priority: PRIORITY,
                cpu: None,
                lock_memory: config.control.priority > 0,
            };
            let granted = realtime::request(wanted);
            for warning in &granted.warnings {
                print(log, format_args!("warning: {warning}"));
            }
            let (config, domain, presence) = (&config, &domain, &presence);
            let watched = Watched { config, domain, presence, silence };
            let had_port = watchdog::run(watched, &stop, &mut |event| {
                for line in event.to_string().lines() {
                    print(log, format_args!("{line}"));
                }
            });
            service_manager::notify(service_manager::STOPPING);
            if !had_port {
                return Err(
                    "no port could be opened; nothing to watch; connect the drives or correct \
                            `device`, then restart"
                        .into(),
                );
            }
            Ok(())
        }
    }
}

fn print(log: &mut ConsoleLog, line: std::fmt::Arguments<'_>) {
    let _ = writeln!(log, "[{:12.6}] {line}", clock::now().as_seconds());
}

fn parse(arguments: impl IntoIterator<Item = OsString>) -> Result<Request, lexopt::Error> {
    let mut parser = lexopt::Parser::from_args(arguments);
    let (mut config, mut silence) = (None, watchdog::DEFAULT_SILENCE);
    while let Some(argument) = parser.next()? {
        match argument {
            Short('h') | Long("help") => return Ok(Request::Help),
            Short('V') | Long("version") => return Ok(Request::Version),
            Short('c') | Long("config") => config = Some(PathBuf::from(parser.value()?)),
            Long("silence-ms") => {
                let text = parser.value()?.string()?;
                let milliseconds = text.parse().ok().filter(|ms| (50..=10_000).contains(ms));
                let refusal = || format!("--silence-ms {text}: must be 50 to 10000");
                silence = Nanos::from_millis(milliseconds.ok_or_else(refusal)?);
            }
            other => return Err(other.unexpected()),
        }
    }
    let config = config.ok_or("no configuration: use --config FILE")?;
    Ok(Request::Run(config, silence))
}
