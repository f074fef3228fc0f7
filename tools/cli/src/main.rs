//! The command line of i2ris.
//!
//! One file per subcommand: its arguments, and `run`. What they do lives in the libraries; here is
//! what a person sees.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command line prints"
)]

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use i2ris_record::series;

mod bench;
mod bridge;
mod calibrate;
mod command;
mod completions;
mod config;
mod console;
mod demo;
mod doctor;
mod emulate;
mod exit;
mod files;
mod model;
mod monitor;
mod record;
mod replay;
mod report;
mod vision;
mod working;

/// Whatever ends a subcommand: one sentence for a person.
type Failure = Box<dyn std::error::Error>;

/// Calibrate, emulate, command and watch the I2RIS snake robot.
#[derive(Debug, Parser)]
#[command(name = "i2ris", version, propagate_version = true, arg_required_else_help = true, after_help = exit::HELP)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Fit a model to a recording
    #[command(subcommand)]
    Calibrate(calibrate::Command),
    /// Look at a model, and run it without a robot
    #[command(subcommand)]
    Model(model::Command),
    /// Run two emulated drives with a snake behind them
    Emulate(emulate::Arguments),
    /// Check ports, drives and machine before the robot moves
    Doctor(doctor::Arguments),
    /// Command the robot
    Command(command::Arguments),
    /// Watch the robot
    Monitor(monitor::Arguments),
    /// A console on another computer: watch, and command, over the network
    Bridge(bridge::Arguments),
    /// Look at a configuration
    #[command(subcommand)]
    Config(config::Command),
    /// Measure latencies of this machine and of the controller's ways
    Bench(bench::Arguments),
    /// Print what a shell needs to complete commands
    Completions(completions::Arguments),
    /// Record trials, and make tables of recordings
    Record(record::Arguments),
    /// Make a page of a recorded trial: tracking error, hysteresis, latencies, events
    Report(report::Arguments),
    /// Run the black box of a controller again and compare to the bit
    Replay(replay::Arguments),
    /// Have the running controller write its black box: the last seconds of every tick
    Dump(replay::DumpArguments),
    /// Measure angles in microscope pictures
    Vision(vision::Arguments),
    /// Show the whole path on the emulator: calibrate, fit, follow, measure
    Demo(demo::Arguments),
}

impl Task {
    /// Whether it only prints. Such a one ends without a word when its reader goes away (`| head`),
    /// as every tool of a shell does; one that moves the robot, or holds something that has to be
    /// given back, finishes in order.
    fn only_prints(&self) -> bool {
        match self {
            Self::Model(_)
            | Self::Doctor(_)
            | Self::Config(_)
            | Self::Completions(_)
            | Self::Replay(_) => true,
            Self::Bench(_) | Self::Vision(_) | Self::Report(_) => true,
            Self::Calibrate(command) => command.only_prints(),
            Self::Emulate(_) | Self::Command(_) | Self::Monitor(_) | Self::Bridge(_) => false,
            Self::Record(arguments) => arguments.only_prints(),
            Self::Dump(_) | Self::Demo(_) => false,
        }
    }
}

/// The kernel ends the program when nobody reads what it prints.
fn end_when_nobody_reads() {
    use nix::sys::signal::{SigHandler, Signal, signal};
    // SAFETY: no handler of ours is replaced; at this point there is one thread.
    let _ = unsafe { signal(Signal::SIGPIPE, SigHandler::SigDfl) };
}

fn main() -> ExitCode {
    let task = Cli::parse().task;
    if task.only_prints() {
        end_when_nobody_reads();
    }
    let outcome = match task {
        Task::Calibrate(command) => calibrate::run(command),
        Task::Model(command) => model::run(command),
        Task::Emulate(arguments) => emulate::run(arguments),
        Task::Doctor(arguments) => doctor::run(arguments),
        Task::Command(arguments) => command::run(arguments),
        Task::Monitor(arguments) => monitor::run(arguments),
        Task::Bridge(arguments) => bridge::run(&arguments),
        Task::Config(command) => config::run(&command),
        Task::Bench(arguments) => bench::run(&arguments),
        Task::Completions(arguments) => completions::run(&arguments),
        Task::Record(arguments) => record::run(arguments),
        Task::Report(arguments) => report::run(&arguments),
        Task::Replay(arguments) => replay::run(&arguments),
        Task::Dump(arguments) => replay::dump(&arguments),
        Task::Vision(arguments) => vision::run(arguments),
        Task::Demo(arguments) => demo::run(arguments),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            exit::code(&failure)
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn every_subcommand_has_an_example_that_names_it_and_what_is_told_of_options_is_consistent() {
        let mut command = Cli::command();
        command.build();
        for subcommand in command
            .get_subcommands_mut()
            .filter(|it| it.get_name() != "help")
        {
            let (name, help) = (
                subcommand.get_name().to_owned(),
                subcommand.render_long_help().to_string(),
            );
            assert!(
                help.contains("Example") && help.contains(&format!("i2ris {name}")),
                "{name}: {help}"
            );
        }
        command.debug_assert();
    }
}
