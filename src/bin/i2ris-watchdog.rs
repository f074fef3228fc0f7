//! The watchdog process: stops the drives when the controller dies or hangs.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::watchdog_presence::WatchdogPresence;
use i2ris::process::console_log::ConsoleLog;
use i2ris::process::{Failure, read_command_line, run_process};
use i2ris::realtime::{self, SchedulingRequest};
use i2ris::service_manager;
use i2ris::units::Nanos;
use i2ris::watchdog::{self, Watched};
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

fn main() -> ExitCode {
    run_process(start)
}

fn start(log: &mut ConsoleLog) -> Result<(), Failure> {
    let mut silence = watchdog::DEFAULT_SILENCE;
    let config = read_command_line("i2ris-watchdog", HELP, |option, parser| {
        let is_known = option == "silence-ms";
        if is_known {
            let text = parser.value()?.string()?;
            let milliseconds = text.parse().ok().filter(|ms| (50..=10_000).contains(ms));
            let refusal = || format!("--silence-ms {text}: must be 50 to 10000");
            silence = Nanos::from_millis(milliseconds.ok_or_else(refusal)?);
        }
        Ok(is_known)
    })?;
    let Some(config) = config else { return Ok(()) };
    let domain = Domain::new(&config.domain)?;
    let presence = WatchdogPresence::announce(&domain, &config.ports_digest())?;
    let stop = Arc::new(AtomicBool::new(false));
    let requested = Arc::clone(&stop);
    ctrlc::set_handler(move || requested.store(true, Ordering::Release))?;
    let lock_memory = config.control.priority > 0;
    let granted = realtime::request(SchedulingRequest { lock_memory, ..watchdog::REAL_TIME });
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
    if had_port {
        return Ok(());
    }
    Err("no port could be opened; nothing to watch; connect the drives or correct `device`, then \
         restart"
        .into())
}

fn print(log: &mut ConsoleLog, line: std::fmt::Arguments<'_>) {
    let _ = writeln!(log, "[{:12.6}] {line}", clock::now().as_seconds());
}
