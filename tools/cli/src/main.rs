//! The command line of i2ris.
//!
//! One file per subcommand: its arguments, and `run`. The libraries do the work. Parts that are
//! slow to build and rarely needed are separate programs: `i2ris NAME` runs `i2ris-NAME`.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod calibrate;
mod command;
mod commission;
mod csv_table;
mod demo;
mod doctor;
mod emulate;
mod model;
mod numbers;
mod preflight;
mod procedure;
mod progress_bar;
mod start;
mod stop;
mod teleop;
#[cfg(test)]
mod wrong_benches;

use std::ffi::{OsStr, OsString};
use std::io::{Write, stdout};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitCode};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::{Shell, generate};
use i2ris::ipc::StateCommand;
use i2ris_report::program::{DESCRIBE, PARSE, describe, end_with_reader, finish, parsed, perform};
use i2ris_report::programs::{PROGRAMS, Program, find};
use i2ris_report::{Failure, description::Description, tips, until_closed};

/// Calibrate, emulate, command and monitor the I2RIS snake robot.
#[derive(Debug, Parser)]
#[command(
    name = "i2ris",
    version,
    propagate_version = true,
    arg_required_else_help = true,
    args_conflicts_with_subcommands = true,
    after_help = i2ris_report::exit::HELP
)]
struct Cli {
    /// Print a script that completes commands and options, also of installed programs:
    /// i2ris --completions bash > ~/.local/share/bash-completion/completions/i2ris
    #[arg(long, value_name = "SHELL", value_enum)]
    completions: Option<Shell>,
    #[command(subcommand)]
    task: Option<Task>,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Run emulator, controller, watchdog and monitor together
    Start(start::Arguments),
    /// Emulate drives, snake and camera
    Emulate(emulate::Arguments),
    /// Calibrate, fit and track on the emulator
    Demo(demo::Arguments),
    /// Check ports, drives, computer and configuration
    Doctor(doctor::Arguments),
    /// Go/no-go check before a trial; moves the snake slightly
    Preflight(preflight::Arguments),
    /// Bring up a new robot, stage by stage
    Commission(commission::Arguments),
    /// Stop every motion now; the drives stay powered
    #[command(alias = "estop", alias = "e-stop", alias = "halt")]
    Stop(stop::Arguments),
    /// Set the zero here (or at a hard stop); straighten the snake first
    Home(command::StateArguments),
    /// Switch the drives on; the robot holds
    Enable(command::StateArguments),
    /// Decelerate, then power the drives off
    Disable(command::StateArguments),
    /// Send poses, paths, states and virtual fixtures
    Command(command::Arguments),
    /// Steer the robot by hand: gamepad, joystick, SpaceMouse, pedal or keyboard
    Teleop(teleop::Arguments),
    /// Record and fit a model: all steps, or one
    Calibrate(calibrate::Arguments),
    /// Use, inspect and roll back models
    #[command(subcommand)]
    Model(model::Command),
}

impl Task {
    /// Whether it only prints, see [`end_with_reader`].
    fn only_prints(&self) -> bool {
        match self {
            Self::Doctor(_) => true,
            Self::Calibrate(arguments) => arguments.only_prints(),
            Self::Model(command) => command.only_prints(),
            _ => false,
        }
    }

    fn run(self) -> Result<(), Failure> {
        match self {
            Self::Start(arguments) => start::run(&arguments),
            Self::Emulate(arguments) => emulate::run(arguments),
            Self::Demo(arguments) => demo::run(arguments),
            Self::Doctor(arguments) => doctor::run(arguments),
            Self::Preflight(arguments) => preflight::run(&arguments),
            Self::Commission(arguments) => commission::run(&arguments),
            Self::Stop(arguments) => stop::run(&arguments),
            Self::Home(arguments) => command::change_state(&arguments, StateCommand::Home),
            Self::Enable(arguments) => command::change_state(&arguments, StateCommand::Enable),
            Self::Disable(arguments) => command::change_state(&arguments, StateCommand::Disable),
            Self::Command(arguments) => command::run(arguments),
            Self::Teleop(arguments) => teleop::run(arguments),
            Self::Calibrate(arguments) => calibrate::run(arguments),
            Self::Model(command) => model::run(command),
        }
    }
}

fn main() -> ExitCode {
    let mut arguments: Vec<OsString> = std::env::args_os().collect();
    let first = arguments.get(1).and_then(|word| word.to_str()).unwrap_or_default();
    let only_parses = first == PARSE;
    if first == DESCRIBE && arguments.len() == 2 {
        return finish(describe(&with_descriptions(Cli::command())));
    }
    if only_parses {
        arguments.remove(1);
    }
    if let Some(mut call) = Call::requested(arguments.get(1..).unwrap_or_default()) {
        if only_parses {
            call.arguments.insert(0, PARSE.into());
        }
        return finish(Err(call.execute()));
    }
    let command = with(Cli::command(), |program| clap::Command::new(program.name()));
    let matches = command.try_get_matches_from(arguments);
    let cli = matches.and_then(|matches| Cli::from_arg_matches(&matches));
    if only_parses {
        return parsed(cli);
    }
    let cli = cli.unwrap_or_else(|error| tips::harmless(error).exit());
    let outcome = match (cli.completions, cli.task) {
        (Some(shell), _) => completions(shell),
        (None, Some(task)) => {
            if task.only_prints() {
                end_with_reader();
            }
            perform(|| task.run())
        }
        // Without arguments clap has printed the help.
        (None, None) => Ok(()),
    };
    finish(outcome.map_err(command::with_code))
}

fn completions(shell: Shell) -> Result<(), Failure> {
    let mut command = with_descriptions(Cli::command());
    let mut script = Vec::new();
    generate(shell, &mut command, "i2ris", &mut script);
    until_closed(stdout().write_all(&script))?;
    Ok(())
}

#[derive(Debug, PartialEq, Eq)]
struct Call {
    program: Program,
    arguments: Vec<OsString>,
}

impl Call {
    /// The call of a program: `NAME ...`, `help NAME ...`.
    fn requested(arguments: &[OsString]) -> Option<Self> {
        let words: Vec<_> = arguments.iter().map(|word| word.to_string_lossy()).collect();
        let is_help = words.first().is_some_and(|word| word == "help");
        let (program, rest) = Program::of(&words[usize::from(is_help)..])?;
        let rest = &arguments[arguments.len() - rest.len()..];
        let arguments = match (is_help, rest) {
            (false, rest) => rest.to_vec(),
            (true, []) => vec!["--help".into()],
            (true, rest) => [&["help".into()], rest].concat(),
        };
        Some(Self { program, arguments })
    }

    /// Replaces this process by the program. Returns only if that fails.
    fn execute(self) -> Failure {
        let Some(program) = find(self.program.name()) else {
            return self.program.how_to_install().into();
        };
        let error = Command::new(&program).args(self.arguments).exec();
        format!("cannot start {}: {error}", program.display()).into()
    }
}

/// `i2ris` with the command lines of the programs found, and the names of the others.
fn with_descriptions(command: clap::Command) -> clap::Command {
    with(command, |program| {
        let name = program.name();
        let description = find(name).and_then(|file| described(&file));
        description.map_or_else(|| clap::Command::new(name), |it| it.command(name))
    })
}

fn with(command: clap::Command, of: impl Fn(Program) -> clap::Command) -> clap::Command {
    PROGRAMS.into_iter().fold(command, |command, program| {
        let own = of(program).about(program.about);
        match program.words.split_once(' ') {
            Some((parent, _)) => command.mut_subcommand(parent, |parent| {
                parent.args_conflicts_with_subcommands(true).subcommand(own)
            }),
            None => command.subcommand(own),
        }
    })
}

fn described(program: &Path) -> Option<Description> {
    let output = Command::new(program).arg(OsStr::new(DESCRIBE)).output().ok()?;
    serde_json::from_slice(&output.stdout).ok()
}
