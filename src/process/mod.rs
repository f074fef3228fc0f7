//! The controller process: threads, channels, files. Decisions are made in [`crate::core`].
//!
//! | file | content |
//! |---|---|
//! | `controller` | start and shutdown of the process |
//! | `start_up` | model, ports and drives at the start |
//! | `threads` | starting, naming and joining threads; final power state of the drives |
//! | `control_loop` | the real-time loop thread; the only place that runs the cycle |
//! | `ipc_thread` | shared memory: commands in, messages out |
//! | `model_manager` | the model thread: reads, checks, compares, frees |
//! | `model_comparison` | difference between two models, in counts |
//! | `loop_statistics` | period, lateness and computing time of the loop, window by window |
//! | `loop_history` | motor positions and loaded models, shared by the slower threads |
//! | `main_thread` | writes the log and waits for the end |
//! | `fixture_table` | names and values of the virtual fixtures, for clients |
//! | `camera_owner` | selection of the camera to follow |
//! | `channels` | channels between the threads |
//! | `payload_conversion` | conversion between payloads and values of the core |
//! | `console_log` | the log on the terminal, which never blocks |
//! | [`black_box`] | the last seconds of every tick: recorder, file, replay |
//! | [`run_log`] | one line of JSON per start, end and change of state |

pub mod black_box;
mod camera_owner;
mod channels;
pub mod console_log;
mod control_loop;
pub mod controller;
mod fixture_table;
mod ipc_thread;
mod loop_history;
mod loop_statistics;
mod main_thread;
pub mod model_comparison;
mod model_manager;
mod payload_conversion;
pub mod run_log;
mod start_up;
mod threads;

use std::error::Error;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use lexopt::Arg::{Long, Short};

use crate::COMMIT;
use crate::config::{Config, ConfigError};
use console_log::ConsoleLog;
use controller::ControllerError;
pub use payload_conversion::{operating_state, robot_description};

/// Makes a write beyond the file-size limit fail, as on a full disk: by default it kills.
pub fn survive_file_size_limit() {
    // SAFETY: no handler is replaced.
    let _ = unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

/// Why a process ends.
pub type Failure = Box<dyn Error>;

#[derive(Debug, thiserror::Error)]
#[error("{error}; see {program} --help")]
struct UsageError {
    program: &'static str,
    error: lexopt::Error,
}

/// The configuration that the command line names; `None`: help or version was asked for and is
/// printed. `option` reads an option of this program alone, or says that it is not one.
pub fn read_command_line(
    program: &'static str,
    help: &str,
    mut option: impl FnMut(&str, &mut lexopt::Parser) -> Result<bool, lexopt::Error>,
) -> Result<Option<Config>, Failure> {
    let mut parser = lexopt::Parser::from_args(std::env::args_os().skip(1));
    let mut parse = || {
        let mut config = None;
        while let Some(argument) = parser.next()? {
            match argument {
                Short('h') | Long("help") => return Ok(Err(help.to_owned())),
                Short('V') | Long("version") => {
                    let version = env!("CARGO_PKG_VERSION");
                    return Ok(Err(format!("{program} {version} ({COMMIT})\n")));
                }
                Short('c') | Long("config") => config = Some(PathBuf::from(parser.value()?)),
                Long(name) => {
                    let name = name.to_owned();
                    if !option(&name, &mut parser)? {
                        return Err(Long(&name).unexpected());
                    }
                }
                other => return Err(other.unexpected()),
            }
        }
        Ok(Ok(config.ok_or("no configuration: use --config FILE")?))
    };
    match parse().map_err(|error| UsageError { program, error })? {
        Ok(path) => Ok(Some(Config::load_for_process(&path)?)),
        Err(text) => Ok(io::stdout().write_all(text.as_bytes()).map(|()| None)?),
    }
}

/// The same codes as those of `i2ris`.
fn exit_code(failure: &Failure) -> u8 {
    match failure.downcast_ref() {
        _ if failure.is::<UsageError>() => 2,
        _ if failure.is::<ConfigError>() => 6,
        Some(ControllerError::Powered { .. }) => 8,
        _ => 1,
    }
}

/// Main function of a process: starts the log and prints the final error. The log has its own
/// thread, because a blocked terminal must not delay stopping the drives.
pub fn run_process(start: impl FnOnce(&mut ConsoleLog) -> Result<(), Failure>) -> ExitCode {
    survive_file_size_limit();
    let mut log = match ConsoleLog::start(io::stderr()) {
        Ok(log) => log,
        Err(failure) => {
            let _ = writeln!(io::stderr(), "error: cannot start a thread: {failure}");
            return ExitCode::FAILURE;
        }
    };
    log.take_panic_messages();
    match start(&mut log) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            let _ = writeln!(log, "error: {failure}");
            ExitCode::from(exit_code(&failure))
        }
    }
}
