//! `i2ris bench`: how fast it is on this machine, each figure beside what the machine itself needs, in the same run.
//!
//! | file | holds |
//! |---|---|
//! | `ipc` | from one thread to another: shared memory, sockets |
//! | `ticks` | a periodic loop: the controller's ticker, a bare timer |
//! | `spans` | many spans, and the few numbers that tell of them |
//! | `machine` | what it was measured on |

mod ipc;
mod machine;
mod spans;
mod ticks;

use serde::Serialize;

use crate::Failure;
use machine::Machine;
use spans::Summary;

/// Arguments of `i2ris bench`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris bench ipc
  i2ris bench loop --duration-s 30 --json

Run it on an idle machine. On a virtual one, medians mean something and maxima belong to the host.")]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Publish to receive, by polling: both ways of the controller, a bare word in shared memory, sockets
    Ipc(ipc::Arguments),
    /// Lateness of a periodic loop: the controller's ticker and a bare timer, in turns
    Loop(ticks::Arguments),
}

/// One way of doing a thing.
#[derive(Debug, Serialize)]
struct Way {
    name: &'static str,
    /// What the others are compared with: the least that the machine needs, or what everybody has.
    is_reference: bool,
    spans_ns: Summary,
}

/// Everything that is printed.
#[derive(Debug, Serialize)]
struct Outcome {
    bench: &'static str,
    machine: Machine,
    ways: Vec<Way>,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (outcome, json) = match &arguments.what {
        What::Ipc(arguments) => {
            (Outcome { bench: "ipc", ways: ipc::run(arguments)?, machine: machine::look() }, arguments.json)
        }
        What::Loop(arguments) => {
            (Outcome { bench: "loop", ways: ticks::run(arguments)?, machine: machine::look() }, arguments.json)
        }
    };
    if json {
        println!("{}", serde_json::to_string_pretty(&outcome)?);
    } else {
        print(&outcome);
    }
    Ok(())
}

fn print(outcome: &Outcome) {
    println!("{}", outcome.machine.words());
    println!(
        "{:<44} {:>8} {:>9} {:>9} {:>9} {:>9} {:>10} {:>9}",
        "microseconds", "count", "p50", "p90", "p99", "p99.9", "max", "x first"
    );
    let reference = outcome.ways.iter().find(|way| way.is_reference).map(|way| way.spans_ns.p50);
    for Way { name, is_reference, spans_ns } in &outcome.ways {
        let Summary { count, p50, p90, p99, p999, max } = *spans_ns;
        let us = |ns: u64| format!("{:.2}", ns as f64 / 1e3);
        let ratio = match reference {
            Some(reference) if !is_reference && reference > 0 => format!("{:.2}", p50 as f64 / reference as f64),
            _ => "-".to_owned(),
        };
        println!(
            "{name:<44} {count:>8} {:>9} {:>9} {:>9} {:>9} {:>10} {ratio:>9}",
            us(p50),
            us(p90),
            us(p99),
            us(p999),
            us(max)
        );
    }
}
