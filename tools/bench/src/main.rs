//! `i2ris bench`: latencies on this machine, compared with the floor of the same run.
//!
//! A latency has little meaning without the minimum that the machine allows. Every measurement is
//! an [`Outcome`] with several variants. One is a floor. All run in turns in the same run.
//!
//! | file | contains |
//! |---|---|
//! | `control_loop`, `inverse`, `e2e` | the measurements, with models and drives |
//! | `outcome`, `report` | variants, quantities, ratios; as text, JSON and figures |
//! | `machine` | scheduling of threads; properties and load of the machine |
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod control_loop;
mod e2e;
mod inverse;
mod machine;
mod outcome;
mod report;

use std::io::{IsTerminal, stderr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, value_parser};
use i2ris::units::Nanos;
use i2ris_bench::{limits, lines, models};
use i2ris_report::{Failure, Interrupt};
use indicatif::ProgressBar;

use e2e::EndToEndBenchmark;
use inverse::subject;
use machine::Run;
use outcome::Outcome;

/// A timeout of a measurement.
fn busy(what: &str) -> Failure {
    format!("{what}: the machine is too busy to measure on, or a process hangs").into()
}

fn panicked<T>(_: T) -> Failure {
    busy("a thread of the measurement panicked")
}

/// Benchmark computer, controller and models
#[derive(Debug, Parser)]
#[command(name = "i2ris-bench", bin_name = "i2ris bench", version, propagate_version = true)]
#[command(after_help = "Examples:
  i2ris bench loop --duration-s 30 --json
  i2ris bench e2e --commands 2000
  i2ris bench hand
  i2ris bench all --output latencies
  i2ris bench lines --line lab,rs232

`--output` makes a folder: figures as SVG, numbers as JSON.

Run it on an idle machine, built with --release. Threads request SCHED_FIFO and a processor of their
own; without permission they run without and report it. On a virtual machine ratios and medians are
meaningful, maxima are those of the host.")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

/// Scheduling and output of a measurement.
#[derive(Debug, clap::Args)]
struct Measurement {
    /// Print as JSON
    #[arg(long)]
    json: bool,
    /// Write figures and numbers into this folder
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// SCHED_FIFO priority to request; 0: normal scheduling, on any processor
    #[arg(long, value_name = "PRIORITY", default_value_t = 80,
          value_parser = value_parser!(u8).range(0..=98))]
    priority: u8,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Jitter and computing time of a periodic loop: the controller's ticker compared with a bare
    /// timer
    Loop(LoopArguments),
    /// Time of a model inversion: desired angles to counts, and back
    Inverse(InverseArguments),
    /// Latency from command to wire, and back to an encoder position at the client; with emulated
    /// drives
    E2e(EndToEndArguments),
    /// Latency from input device to wire, with an emulated gamepad, `i2ris teleop` and emulated
    /// drives
    Hand(HandArguments),
    /// Tracking with adaptation on emulated snakes that wear, in simulated time
    Models(models::Arguments),
    /// Throughput of serial lines, and its effect on the tip, in simulated time
    Lines(lines::Arguments),
    /// Cost of the joint limits on emulated snakes, in simulated time
    Limits(limits::Arguments),
    /// Loop, inverse and e2e with their defaults, one after the other (two minutes)
    All(Measurement),
}

#[derive(Debug, clap::Args)]
struct LoopArguments {
    /// Ticks per second; several rates, separated by commas, are measured in turn
    #[arg(long, value_name = "HZ", default_value = "1000", value_delimiter = ',',
          value_parser = value_parser!(u32).range(100..=4000))]
    rate_hz: Vec<u32>,
    /// Measuring time of each variant
    #[arg(long, value_name = "S", default_value_t = 10,
          value_parser = value_parser!(u32).range(1..=3600))]
    duration_s: u32,
    /// Model of the controller (default: a fitted force-balance model)
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    #[command(flatten)]
    measurement: Measurement,
}

#[derive(Debug, clap::Args)]
struct InverseArguments {
    /// Passes through the motion of 2000 poses
    #[arg(long, value_name = "N", default_value_t = 50,
          value_parser = value_parser!(u32).range(1..))]
    turns: u32,
    /// Model of the controller (default: a fitted force-balance model)
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    #[command(flatten)]
    measurement: Measurement,
}

#[derive(Debug, clap::Args)]
struct EndToEndArguments {
    /// Number of commands, about 60 per second
    #[arg(long, value_name = "N", default_value_t = 1000,
          value_parser = value_parser!(u64).range(50..))]
    commands: u64,
    /// Random seed of the command times
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Rounds; each measures the bare loop, then the controller
    #[arg(long, value_name = "N", default_value_t = 2,
          value_parser = value_parser!(u32).range(1..=100))]
    turns: u32,
    /// Additional processes that only compute
    #[arg(long, value_name = "N", default_value_t = 0)]
    busy: u32,
    #[command(flatten)]
    measurement: Measurement,
}

#[derive(Debug, clap::Args)]
struct HandArguments {
    /// Number of events, about 12 per second
    #[arg(long, value_name = "N", default_value_t = 400,
          value_parser = value_parser!(u64).range(50..))]
    events: u64,
    /// Random seed of the event times
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Additional processes that only compute
    #[arg(long, value_name = "N", default_value_t = 0)]
    busy: u32,
    #[command(flatten)]
    measurement: Measurement,
}

fn main() -> ExitCode {
    i2ris_report::program::run(|_| true, |arguments: Arguments| run(&arguments))
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    let task = &arguments.task;
    let (Measurement { json, output, priority }, is_all) = match task {
        Task::Models(arguments) => return models::run(arguments),
        Task::Lines(arguments) => return lines::run(arguments),
        Task::Limits(arguments) => return limits::run(arguments),
        Task::Loop(arguments) => (&arguments.measurement, false),
        Task::Inverse(arguments) => (&arguments.measurement, false),
        Task::E2e(arguments) => (&arguments.measurement, false),
        Task::Hand(arguments) => (&arguments.measurement, false),
        Task::All(measurement) => (measurement, true),
    };
    let interrupt = Interrupt::catch()?;
    let run = Run { priority: *priority, interrupt: &interrupt };
    let outcomes = if is_all { all(*json, run)? } else { vec![measured(task, *json, "it", run)?] };
    report::print_outcomes(&outcomes, *json)?;
    let Some(folder) = output else { return Ok(()) };
    report::write_outcomes(folder, &outcomes)?;
    if !json {
        println!("\nwritten: figures and numbers in {}", folder.display());
    }
    Ok(())
}

fn measured(task: &Task, json: bool, name: &str, run: Run) -> Result<Outcome, Failure> {
    let is_hidden = json || !stderr().is_terminal();
    let bar = if is_hidden { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
    let bar = bar.with_message(format!("measuring {name}; Ctrl-C ends"));
    bar.enable_steady_tick(Duration::from_millis(250));
    let outcome = measure(task, run);
    bar.finish_and_clear();
    outcome
}

fn all(json: bool, run: Run) -> Result<Vec<Outcome>, Failure> {
    let of = |name| {
        let task = Arguments::try_parse_from(["i2ris-bench", name])?.task;
        measured(&task, json, name, run)
    };
    ["loop", "inverse", "e2e"].into_iter().map(of).collect()
}

fn measure(task: &Task, run: Run) -> Result<Outcome, Failure> {
    match task {
        Task::Loop(LoopArguments { rate_hz, duration_s, model, .. }) => {
            let period = |rate_hz: &u32| Nanos(1_000_000_000 / u64::from(*rate_hz));
            let periods: Vec<Nanos> = rate_hz.iter().map(period).collect();
            control_loop::run(&periods, *duration_s, subject(model.as_deref())?, run)
        }
        Task::Inverse(InverseArguments { turns, model, .. }) => {
            inverse::run(*turns, subject(model.as_deref())?, run)
        }
        Task::E2e(arguments) => {
            let EndToEndArguments { commands, seed, turns, busy, .. } = *arguments;
            e2e::run(&EndToEndBenchmark { commands, seed, turns, busy }, run)
        }
        Task::Hand(arguments) => {
            let HandArguments { events: commands, seed, busy, .. } = *arguments;
            e2e::hand::run(&EndToEndBenchmark { commands, seed, turns: 1, busy }, run)
        }
        Task::Models(_) | Task::Lines(_) | Task::Limits(_) | Task::All(_) => {
            Err("not a single measurement".into())
        }
    }
}
