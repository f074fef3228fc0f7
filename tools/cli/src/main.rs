//! The command line of i2ris.
//!
//! One file per subcommand: its arguments, and `run`. The libraries do the work. What is heavy to
//! build and rarely needed is a program of its own, see [`external`].
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use i2ris_report::program::{end_with_reader, finish};
use i2ris_report::{Failure, tips};

mod calibrate;
mod command;
mod completions;
mod config;
mod connection;
mod csv_table;
mod demo;
mod doctor;
mod emulate;
mod exit;
mod external;
mod input;
mod model;
mod numbers;
mod process;
mod progress_bar;
mod replay;
mod start;
mod stop;
mod teleop;
mod why;

/// Calibrate, emulate, command and watch the I2RIS snake robot.
#[derive(Debug, Parser)]
#[command(
    name = "i2ris",
    version,
    propagate_version = true,
    arg_required_else_help = true,
    after_help = i2ris_report::exit::HELP
)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Calibrate the robot: all steps, or one of them
    Calibrate(calibrate::Arguments),
    /// Look at a model, and run it without a robot
    #[command(subcommand)]
    Model(model::Command),
    /// Start emulator, controller and monitor, and end all three
    Start(start::Arguments),
    /// Run two emulated drives with a snake behind them
    Emulate(emulate::Arguments),
    /// Check ports, drives and machine before the robot moves
    Doctor(doctor::Arguments),
    /// Hold every client and end every motion, at once
    #[command(alias = "estop", alias = "e-stop", alias = "halt")]
    Stop(stop::Arguments),
    /// Command the robot
    Command(command::Arguments),
    /// Steer the robot by hand: gamepad, joystick, SpaceMouse, pedal or keyboard
    Teleop(teleop::Arguments),
    /// Look at input devices, record them and play what was recorded
    #[command(subcommand)]
    Input(input::Command),
    /// Say why the robot does not move as asked, and what to do
    Why(why::Arguments),
    /// Look at a configuration
    #[command(subcommand)]
    Config(config::Command),
    /// Print what a shell needs to complete commands
    Completions(completions::Arguments),
    /// Run the black box of a controller again and compare to the bit
    Replay(replay::Arguments),
    /// Have the running controller write its black box: the last seconds of every tick
    Dump(replay::DumpArguments),
    /// Show the whole path on the emulator: calibrate, fit, follow, measure
    Demo(demo::Arguments),
}

impl Task {
    /// Whether it only prints, see [`end_with_reader`].
    fn only_prints(&self) -> bool {
        match self {
            Self::Model(_)
            | Self::Doctor(_)
            | Self::Why(_)
            | Self::Config(_)
            | Self::Completions(_)
            | Self::Replay(_) => true,
            Self::Calibrate(arguments) => arguments.only_prints(),
            Self::Start(_)
            | Self::Emulate(_)
            | Self::Stop(_)
            | Self::Command(_)
            | Self::Teleop(_)
            | Self::Input(_)
            | Self::Dump(_)
            | Self::Demo(_) => false,
        }
    }

    fn run(self) -> Result<(), Failure> {
        match self {
            Self::Calibrate(arguments) => calibrate::run(arguments),
            Self::Model(command) => model::run(command),
            Self::Start(arguments) => start::run(&arguments),
            Self::Emulate(arguments) => emulate::run(arguments),
            Self::Doctor(arguments) => doctor::run(arguments),
            Self::Stop(arguments) => stop::run(&arguments),
            Self::Command(arguments) => command::run(arguments),
            Self::Teleop(arguments) => teleop::run(&arguments),
            Self::Input(command) => input::run(&command),
            Self::Why(arguments) => why::run(&arguments),
            Self::Config(command) => config::run(&command),
            Self::Completions(arguments) => completions::run(&arguments, Cli::command()),
            Self::Replay(arguments) => replay::run(&arguments),
            Self::Dump(arguments) => replay::dump(&arguments),
            Self::Demo(arguments) => demo::run(arguments),
        }
    }
}

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    if let Some(call) = external::Call::requested(&Cli::command(), &arguments) {
        return finish(Err(call.execute()));
    }
    let matches = external::with_programs(Cli::command()).try_get_matches();
    let task = match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli.task,
        Err(error) => tips::harmless(error).exit(),
    };
    if task.only_prints() {
        end_with_reader();
    }
    finish(task.run().map_err(exit::with_code))
}
