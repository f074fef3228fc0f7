//! `i2ris bench`: how fast it is on this machine, each figure beside what the machine itself needs,
//! in the same run.
//!
//! | file | holds |
//! |---|---|
//! | `what` | arguments of every measurement, and running it |
//! | `tell` | what is printed |

mod tell;
mod what;

use std::path::PathBuf;

use i2ris_bench::{Outcome, show};

use crate::Failure;
use crate::console::Interrupt;

/// Arguments of `i2ris bench`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris bench ipc
  i2ris bench loop --duration-s 30 --json
  i2ris bench e2e --commands 2000
  i2ris bench all --output latencies

`--output` makes a folder: a page with figures (index.html), figures as SVG, numbers as JSON, HDR histogram logs (.hlog).

Run it on an idle machine, built with --release. Threads ask for SCHED_FIFO and for a processor of their own; without
permission they go on without and say so. On a virtual machine ratios and medians mean something, maxima belong to the host.")]
pub struct Arguments {
    #[command(subcommand)]
    what: what::What,
    /// Print as JSON
    #[arg(long, global = true)]
    json: bool,
    /// Write page, figures, numbers and histograms into this folder
    #[arg(long, value_name = "DIR", global = true)]
    output: Option<PathBuf>,
    /// SCHED_FIFO priority to ask for; 0: stay as it is
    #[arg(long, value_name = "PRIORITY", default_value_t = 80, global = true,
          value_parser = clap::value_parser!(u8).range(0..=98))]
    priority: u8,
    /// Let the scheduler choose processors
    #[arg(long, global = true)]
    unpinned: bool,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let seats = i2ris_bench::Seats {
        priority: arguments.priority,
        pinned: !arguments.unpinned,
    };
    let run = what::Run {
        seats,
        interrupt: &interrupt,
        quiet: arguments.json,
    };
    let outcomes = run.measure(&arguments.what)?;
    if arguments.json {
        println!("{:#}", as_json(&outcomes));
    } else {
        outcomes.iter().for_each(tell::print);
    }
    if let Some(folder) = &arguments.output {
        let written = show::write(folder, &outcomes)?;
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
fn as_json(outcomes: &[Outcome]) -> serde_json::Value {
    match outcomes {
        [one] => show::json(one),
        all => all.iter().map(show::json).collect::<Vec<_>>().into(),
    }
}
