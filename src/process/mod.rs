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

use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

use console_log::ConsoleLog;
pub use payload_conversion::{operating_state, robot_description};

/// Makes a write beyond the file-size limit fail, as on a full disk. By default it kills the
/// process.
pub fn survive_file_size_limit() {
    // SAFETY: no handler is replaced.
    let _ = unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

/// Main function of a process: starts the log and prints the final error. The log has its own
/// thread, because a blocked terminal must not delay stopping the drives. `code`: exit code of a
/// failure.
pub fn run_process<E: Display>(
    start: impl FnOnce(&mut ConsoleLog) -> Result<(), E>,
    code: impl FnOnce(&E) -> u8,
) -> ExitCode {
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
            ExitCode::from(code(&failure))
        }
    }
}
