//! `i2ris bench`: latencies on this machine, compared with the floor of the same run.
//!
//! | file | contains |
//! |---|---|
//! | `arguments` | arguments of the measurements; runs a measurement |
//! | `print` | the table of an outcome |
//! | `compare` | compares two versions |
//! | `scale` | how cost grows |
//! | `instructions` | instructions per call, counted under valgrind |
//! | `peers` | the Rust side of `peers.py` |
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod arguments;
mod compare;
mod instructions;
mod peers;
mod print;
mod scale;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use i2ris_bench::{BenchOutcome, ThreadPlacement, output};
use i2ris_terminal::{Failure, Interrupt};

use arguments::{Measurement, Runner};

/// Measure latencies of this machine and of the controller
#[derive(Debug, Parser)]
#[command(name = "i2ris-bench", bin_name = "i2ris bench", version, propagate_version = true)]
#[command(after_help = "Examples:
  i2ris bench ipc
  i2ris bench loop --duration-s 30 --json
  i2ris bench e2e --commands 2000
  i2ris bench all --output latencies
  i2ris bench wire --baud 115200,1000000 --axes 1,2,4
  i2ris bench scale --output growth
  i2ris bench compare old.json new.json --against old/i2ris-bench -- inverse --rounds 5
  i2ris bench instructions

`--output` makes a folder: a page with figures (index.html), figures as SVG, numbers as JSON,
HDR histogram logs (.hlog).

Run it on an idle machine, built with --release. Threads request SCHED_FIFO and a processor of their
own; without permission they run without and report it. On a virtual machine ratios and medians are
meaningful, maxima are those of the host.")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
    /// Print as JSON
    #[arg(long, global = true)]
    json: bool,
    /// Write page, figures, numbers and histograms into this folder
    #[arg(long, value_name = "DIR", global = true)]
    output: Option<PathBuf>,
    /// SCHED_FIFO priority to request; 0: normal scheduling
    #[arg(long, value_name = "PRIORITY", default_value_t = 80, global = true,
          value_parser = clap::value_parser!(u8).range(0..=98))]
    priority: u8,
    /// Let the scheduler choose processors
    #[arg(long, global = true)]
    unpinned: bool,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    #[command(flatten)]
    Measure(Measurement),
    /// Measure how cost grows with rows, components, plays, clients, axes and the rate of the loop;
    /// takes about a minute
    Scale(scale::ScaleArguments),
    /// Say which medians of two versions differ by more than the noise of repeated runs
    Compare(compare::CompareArguments),
    /// Count the instructions of every call of a model, independent of other load; needs valgrind
    Instructions,
    /// Call a model many times; `instructions` counts this
    #[command(hide = true)]
    Repeat { call: String, components: usize, plays: usize, rounds: usize },
    /// Fit synthetic rows and print time and memory; `scale` measures this
    #[command(hide = true)]
    FitCost { rows: usize },
    /// Fit and predict the data of `peers.py`, and print the result as JSON
    #[command(hide = true)]
    Peers { file: String },
}

fn main() -> ExitCode {
    i2ris_terminal::program::run(|_| true, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match &arguments.task {
        Task::Measure(measurement) => measure(&arguments, measurement),
        Task::Instructions => instructions::table(),
        Task::Repeat { call, components, plays, rounds } => {
            instructions::repeat(call, *components, *plays, *rounds)
        }
        Task::Scale(scale) => scale::measure(scale, arguments.output.as_deref(), arguments.json),
        Task::Compare(compare) => compare::run(compare, arguments.json),
        Task::FitCost { rows } => scale::fit(*rows),
        Task::Peers { file } => peers::answer(file),
    }
}

fn measure(arguments: &Arguments, measurement: &Measurement) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let placement = ThreadPlacement { priority: arguments.priority, pinned: !arguments.unpinned };
    let runner = Runner { placement, interrupt: &interrupt, quiet: arguments.json };
    let outcomes = runner.measure(measurement)?;
    if arguments.json {
        println!("{:#}", as_json(&outcomes));
    } else {
        for outcome in &outcomes {
            print::print(outcome);
        }
        print::summary(&outcomes);
    }
    if let Some(folder) = &arguments.output {
        let written = output::write(folder, &outcomes)?;
        if !arguments.json {
            println!(
                "\nwritten: {} and {} more",
                folder.join("index.html").display(),
                written.len() - 1
            );
        }
    }
    Ok(())
}

/// One object, or an array of all.
fn as_json(outcomes: &[BenchOutcome]) -> serde_json::Value {
    match outcomes {
        [one] => output::json(one),
        all => all.iter().map(output::json).collect::<Vec<_>>().into(),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_help_has_an_example_and_the_command_line_is_consistent() {
        let mut command = Arguments::command();
        let help = command.render_long_help().to_string();
        assert!(help.contains("Example") && help.contains("i2ris bench"), "{help}");
        command.debug_assert();
    }
}
