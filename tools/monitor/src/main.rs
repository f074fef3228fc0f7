//! `i2ris status`: shows why the robot does not move, and the streams of the controller: as text,
//! once or every second, or as a web page.
//!
//! | part | does |
//! |---|---|
//! | `dashboard` | reads every stream: all known data, and the view that the parts below display |
//! | `history`, `event_log` | last seconds, last events |
//! | `lines` | lines of text |
//! | `status` | reasons with advice, the end of the last run, and everything else |
//! | `web` | the page; it holds a dashboard and no client |
//!
//! The control loop is not affected: a slow subscriber loses the oldest messages, and the loop
//! never waits.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod dashboard;
mod event_log;
mod history;
mod lines;
mod status;
mod web;

use std::process::ExitCode;

use clap::Parser;
use i2ris::units::Nanos;
use i2ris_report::{DomainOption, Failure};

/// Show why the robot does not move, and what to do
#[derive(Debug, Parser)]
#[command(name = "i2ris-status", bin_name = "i2ris status", version, propagate_version = true)]
#[command(after_help = "Examples:
  i2ris status                      why it does not move, what to do, and everything once
  i2ris status --watch              the same every second; `i2ris stop` stops the robot
  i2ris status --web                a read-only page: http://127.0.0.1:8766/
  i2ris status --web 8080           the same on another port

The reasons that prevent motion now come first, then the last refusals, stops and clips with their \
age. Two lines each: code, sentence, measured value and limit; and the action.

Exit codes: 0 ended normally, 2 wrong arguments, 3 no controller (except --web, which waits for \
one).")]
struct Arguments {
    #[command(flatten)]
    domain: DomainOption,
    /// Print JSON
    #[arg(long, conflicts_with_all = ["watch", "web"])]
    json: bool,
    /// Print the same every second, until Ctrl-C
    #[arg(long, conflicts_with = "web")]
    watch: bool,
    /// With --watch or --web: stop after this many seconds instead of on Ctrl-C
    #[arg(long, value_name = "S")]
    duration_s: Option<f64>,
    /// Serve a read-only page for a browser at PORT, ADDRESS or ADDRESS:PORT
    #[arg(long, value_name = "ADDR", num_args = 0..=1,
          default_missing_value = web::DEFAULT_ADDRESS)]
    web: Option<web::ListenAddress>,
}

fn main() -> ExitCode {
    let only_prints = |it: &Arguments| !it.watch && it.web.is_none();
    i2ris_report::program::run(only_prints, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    let domain = arguments.domain.domain()?;
    let span = arguments.duration_s.map(|seconds| Nanos((seconds.max(0.0) * 1e9) as u64));
    if let Some(address) = arguments.web {
        return web::run(&domain, address, span);
    }
    if arguments.watch {
        status::watch(&domain, span)
    } else {
        status::once(&domain, arguments.json)
    }
}
