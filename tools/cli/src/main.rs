//! The command line of i2ris.
//!
//! One file per subcommand: its arguments, and `run`. What they do lives in the libraries; here is what a person sees.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command line prints")]

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use i2ris_record::series;

mod bench;
mod calibrate;
mod command;
mod completions;
mod config;
mod console;
mod demo;
mod doctor;
mod emulate;
mod files;
mod model;
mod monitor;
mod record;
mod replay;
mod report;
mod vision;

/// Whatever ends a subcommand: one sentence for a person.
type Failure = Box<dyn std::error::Error>;

/// Calibrate, emulate, command and watch the I2RIS snake robot.
#[derive(Debug, Parser)]
#[command(name = "i2ris", version, propagate_version = true, arg_required_else_help = true)]
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

fn main() -> ExitCode {
    let outcome = match Cli::parse().task {
        Task::Calibrate(command) => calibrate::run(command),
        Task::Model(command) => model::run(command),
        Task::Emulate(arguments) => emulate::run(arguments),
        Task::Doctor(arguments) => doctor::run(arguments),
        Task::Command(arguments) => command::run(arguments),
        Task::Monitor(arguments) => monitor::run(arguments),
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
            ExitCode::FAILURE
        }
    }
}
