//! The main function of a program: command line, exit code, the option `--domain`, and signals that
//! ask it to end.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

use std::any::Any;
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind, set_hook, take_hook};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Parser;
use i2ris::ipc::{Domain, DomainError};
use nix::sys::signal::{SigHandler, Signal, signal};

use crate::description::Description;
use crate::{Failure, exit, tips};

/// The only argument of a program that must describe its command line, see [`Description`].
pub const DESCRIBE: &str = "--describe-command-line";
/// The first argument of a program that only reads the rest of its command line: nothing runs.
pub const PARSE: &str = "--parse-command-line";

/// Runs a program: reads its command line, does the work, reports a failure on standard error.
///
/// `only_prints` says whether these arguments only print. Such a run ends silently when the reader
/// of its output goes away (`| head`). A run that moves the robot, or holds a resource, ends
/// cleanly instead.
pub fn run<Arguments: Parser>(
    only_prints: impl FnOnce(&Arguments) -> bool,
    work: impl FnOnce(Arguments) -> Result<(), Failure>,
) -> ExitCode {
    let mut words: Vec<_> = std::env::args_os().collect();
    if words.len() == 2 && words[1] == DESCRIBE {
        return finish(describe(&Arguments::command()));
    }
    let only_parses = words.get(1).is_some_and(|first| first == PARSE);
    if only_parses {
        words.remove(1);
    }
    let arguments = Arguments::try_parse_from(words);
    if only_parses {
        return parsed(arguments);
    }
    let arguments = arguments.unwrap_or_else(|error| tips::harmless(error).exit());
    if only_prints(&arguments) {
        end_with_reader();
    }
    finish(perform(|| work(arguments)))
}

/// Does the work. If its output cannot be written, it ends cleanly, and with a message.
pub fn perform(work: impl FnOnce() -> Result<(), Failure>) -> Result<(), Failure> {
    i2ris::process::survive_file_size_limit();
    let usual = take_hook();
    set_hook(Box::new(move |info| {
        if cannot_print(info.payload()).is_none() {
            usual(info);
        }
    }));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let Some(text) = cannot_print(&*panic) else { resume_unwind(panic) };
        let is_closed = text.contains("Input/output error");
        let code = if is_closed { exit::INTERRUPTED } else { 1 };
        Err(exit::Coded { code, sentence: format!("cannot write to {text}") }.into())
    })
}

/// The reason in the panic message of a failed `println!`.
fn cannot_print(panic: &(dyn Any + Send)) -> Option<&str> {
    panic.downcast_ref::<String>()?.strip_prefix("failed printing to ")
}

/// The outcome of [`PARSE`]: prints what kind of mistake was made.
pub fn parsed<T>(arguments: Result<T, clap::Error>) -> ExitCode {
    match arguments {
        Ok(_) => ExitCode::SUCCESS,
        Err(error) if error.exit_code() == 0 => ExitCode::SUCCESS,
        Err(error) => {
            println!("{:?}", error.kind());
            ExitCode::from(2)
        }
    }
}

/// Prints a command line for [`DESCRIBE`].
pub fn describe(command: &clap::Command) -> Result<(), Failure> {
    println!("{}", serde_json::to_string(&Description::new(command))?);
    Ok(())
}

/// Memory limit of a program on the computer of the controller, bytes: many times its needs.
const MEMORY: u64 = 2 << 30;

/// Limits a program that strangers can send to: one forged message must not take the memory of the
/// computer from the controller. The program gets at most two gigabytes and ends if it needs more.
/// If memory is short, the kernel ends it first.
pub fn yield_to_controller() {
    let limit = nix::libc::rlimit { rlim_cur: MEMORY, rlim_max: MEMORY };
    // SAFETY: reads the value that it is given.
    let _ = unsafe { nix::libc::setrlimit(nix::libc::RLIMIT_DATA, &raw const limit) };
    // Raising one's own score needs no rights. Without /proc there is no score to raise.
    let _ = std::fs::write("/proc/self/oom_score_adj", "500");
}

/// Lets the kernel end the program when the reader of its output goes away.
pub fn end_with_reader() {
    // SAFETY: this replaces no handler of the program, and only one thread runs.
    let _ = unsafe { signal(Signal::SIGPIPE, SigHandler::SigDfl) };
}

/// Reports a failure on standard error and returns the exit code.
pub fn finish(outcome: Result<(), Failure>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            let _ = writeln!(std::io::stderr(), "error: {failure}");
            ExitCode::from(exit::code(&failure))
        }
    }
}

/// `--domain`.
#[derive(Debug, clap::Args)]
pub struct DomainOption {
    /// Domain of the controller in shared memory
    #[arg(long, env = "I2RIS_DOMAIN", default_value = "i2ris", value_name = "NAME")]
    domain: String,
}

impl DomainOption {
    /// Whether other programs find this domain without the option and the environment.
    pub fn is_default(&self) -> bool {
        self.domain == "i2ris"
    }

    pub fn domain(&self) -> Result<Domain, DomainError> {
        Domain::new(&self.domain)
    }
}

/// Whether the user or the system has requested the end of the program.
#[derive(Debug, Clone)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Catches SIGINT, SIGTERM and SIGHUP. The second one ends the program with exit code 130.
    pub fn catch() -> Result<Self, ctrlc::Error> {
        let flag = Arc::new(AtomicBool::new(false));
        let caught = Arc::clone(&flag);
        ctrlc::set_handler(move || {
            if caught.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        })?;
        Ok(Self(flag))
    }

    pub fn came(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
