//! The watchdog process: stops the drives when the controller dies or hangs.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::COMMIT;
use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::Domain;
use i2ris::realtime::{self, Wanted};
use i2ris::units::Nanos;
use i2ris::watchdog;

const HELP: &str = "\
Stops the drives of the I2RIS snake robot when its controller dies or hangs

Usage: i2ris-watchdog --config FILE [--silence-ms N]

Options:
  --config FILE    The configuration of the controller
  --silence-ms N   Silence of the control loop after which quick stop is sent, 10 to 10000
                   [default: 40]
  --version        Print the version
  --help           Print this

Start it before the controller, which locks its ports for later processes. SIGINT and SIGTERM end
it without a stop of the drives. It is ineffective when the host loses power or hangs as a whole, or
when a cable is disconnected: that needs a hardware watchdog on the safe-torque-off input of the
drives.
";

/// Priority under SCHED_FIFO: above everything of the controller.
const PRIORITY: u8 = 90;

type Failure = Box<dyn std::error::Error>;

enum Request {
    Help,
    Version,
    Run(PathBuf, Nanos),
}

fn main() -> ExitCode {
    match start() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            let _ = writeln!(io::stderr(), "error: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn start() -> Result<(), Failure> {
    match parse(std::env::args_os().skip(1))? {
        Request::Help => Ok(io::stdout().write_all(HELP.as_bytes())?),
        Request::Version => Ok(writeln!(
            io::stdout(),
            "i2ris-watchdog {} ({COMMIT})",
            env!("CARGO_PKG_VERSION")
        )?),
        Request::Run(path, silence) => {
            let config = Config::load(&path)?;
            let domain = Domain::new(&config.ipc.domain)?;
            let stop = Arc::new(AtomicBool::new(false));
            let requested = Arc::clone(&stop);
            ctrlc::set_handler(move || requested.store(true, Ordering::Release))?;
            let wanted = Wanted {
                priority: PRIORITY,
                cpu: None,
                lock_memory: config.control.lock_memory,
            };
            let granted = realtime::request(wanted);
            for warning in &granted.warnings {
                report(&format_args!("warning: {warning}"));
            }
            watchdog::run(&config, &domain, silence, &stop, &mut |event| {
                report(&event)
            });
            Ok(())
        }
    }
}

/// Writes the lines of an event. A closed or full log must not stop the watchdog.
fn report(event: &impl std::fmt::Display) {
    let time = clock::now().as_seconds();
    for line in event.to_string().lines() {
        let _ = writeln!(io::stderr(), "[{time:12.6}] {line}");
    }
}

fn parse(mut arguments: impl Iterator<Item = OsString>) -> Result<Request, Failure> {
    let wrong = |what: String| Err(format!("{what}; see i2ris-watchdog --help").into());
    let (mut config, mut silence) = (None, watchdog::DEFAULT_SILENCE);
    while let Some(argument) = arguments.next() {
        match argument.to_str() {
            Some("--help" | "-h") => return Ok(Request::Help),
            Some("--version" | "-V") => return Ok(Request::Version),
            Some("--config" | "-c") => config = arguments.next().map(PathBuf::from),
            Some("--silence-ms") => {
                let text = arguments.next().unwrap_or_default();
                match text
                    .to_str()
                    .and_then(|text| text.parse().ok())
                    .filter(|ms| (10..=10_000).contains(ms))
                {
                    Some(ms) => silence = Nanos::from_millis(ms),
                    None => {
                        return wrong(format!(
                            "--silence-ms {}: must be 10 to 10000",
                            text.display()
                        ));
                    }
                }
            }
            _ => return wrong(format!("unknown argument {}", argument.display())),
        }
    }
    match config {
        Some(path) => Ok(Request::Run(path, silence)),
        None => wrong("no configuration named".to_owned()),
    }
}
