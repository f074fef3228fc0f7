//! The controller process.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::COMMIT;
use i2ris::config::Config;
use i2ris::process::controller;

const HELP: &str = "\
Teleoperation controller for the I2RIS snake robot

Usage: i2ris-control --config FILE [--note TEXT]

Options:
  --config FILE  Configuration (TOML), for example config/emulator.toml
  --note TEXT    Note of the operator for this run, in the run log
  --version      Print the version
  --help         Print this

SIGINT and SIGTERM decelerate, hold, and switch the drives off in order; the exit code is then 0.
";

/// A parsed command line.
enum Request {
    Help,
    Version,
    Run(PathBuf, String),
}

type Failure = Box<dyn std::error::Error>;

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
        Request::Help => print(HELP),
        Request::Version => print(&format!(
            "i2ris-control {} ({COMMIT})\n",
            env!("CARGO_PKG_VERSION")
        )),
        Request::Run(path, note) => {
            let config = Config::load(&path)?;
            let shutdown = Arc::new(AtomicBool::new(false));
            let requested = Arc::clone(&shutdown);
            ctrlc::set_handler(move || requested.store(true, Ordering::Release))?;
            Ok(controller::run(
                &config,
                &note,
                &shutdown,
                &mut io::stderr(),
            )?)
        }
    }
}

fn print(text: &str) -> Result<(), Failure> {
    Ok(io::stdout().write_all(text.as_bytes())?)
}

/// `--note TEXT`, if it is there.
fn note(arguments: &mut impl Iterator<Item = OsString>) -> Result<String, Failure> {
    match arguments.next() {
        None => Ok(String::new()),
        Some(option) if option == "--note" => {
            let text = arguments
                .next()
                .ok_or("--note wants a text; see i2ris-control --help")?;
            Ok(text.to_string_lossy().into_owned())
        }
        Some(more) => Err(format!(
            "unexpected argument {}; see i2ris-control --help",
            more.display()
        )
        .into()),
    }
}

fn parse(mut arguments: impl Iterator<Item = OsString>) -> Result<Request, Failure> {
    let wrong = |what: String| Err(format!("{what}; see i2ris-control --help").into());
    let Some(first) = arguments.next() else {
        return wrong("no configuration named".to_owned());
    };
    let request = match first.to_str() {
        Some("--help" | "-h") => Request::Help,
        Some("--version" | "-V") => Request::Version,
        Some("--config" | "-c") => match arguments.next() {
            Some(path) => Request::Run(path.into(), note(&mut arguments)?),
            None => return wrong("--config wants a file".to_owned()),
        },
        _ => return wrong(format!("unknown argument {}", first.display())),
    };
    match arguments.next() {
        None => Ok(request),
        Some(more) => wrong(format!("unexpected argument {}", more.display())),
    }
}
