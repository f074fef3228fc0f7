//! The controller process: threads, channels, files. Decisions are made in [`crate::core`].
//!
//! | file | content |
//! |---|---|
//! | `controller` | start and end of the process, in order |
//! | `ending` | the end of the threads, and what is known of the drives then |
//! | `start_up` | model, ports and drives at the start |
//! | `threads` | starting, naming and joining threads |
//! | `control_loop` | the real-time loop thread; the only place that runs the cycle |
//! | `ipc_thread` | shared memory: commands in, messages out |
//! | `model_manager` | the model thread: reads, checks, compares, frees |
//! | `model_comparison` | difference between two models, in counts |
//! | `loop_statistics` | period, lateness and computing time of the loop, window by window |
//! | `loop_history` | motor positions and loaded models, shared by the slower threads |
//! | `main_thread` | the log, and waiting for the end |
//! | `fixture_table` | names and values of the virtual fixtures, for clients |
//! | `camera_owner` | which camera is followed |
//! | `channels` | everything that passes between the threads |
//! | `payload_conversion` | conversion between payloads and values of the core |
//! | `console_log` | the log on the terminal, which never blocks |
//! | `event_text` | events as lines of the log |
//! | [`black_box`] | the last seconds of every tick: recorder, file, replay |
//! | [`run_log`] | one line of JSON per start, end and change of state |

pub mod black_box;
mod camera_owner;
mod channels;
pub mod console_log;
mod control_loop;
pub mod controller;
mod ending;
mod event_text;
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

/// A write beyond the limit on the size of files fails from now on, as on a full disk. By default it
/// kills the process.
pub fn survive_file_size_limit() {
    // SAFETY: no handler is replaced.
    let _ = unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

/// The main function of a process: it starts the log, which a thread of its own writes, because a
/// terminal that blocks must not keep drives from being stopped; and prints why it ended. `code`:
/// the exit code of a failure.
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
