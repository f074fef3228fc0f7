//! `i2ris status`: why the robot does not move and the streams of the controller: once, as a
//! terminal screen, as lines, or as a web page.
//!
//! | part | does |
//! |---|---|
//! | `subscriptions` | subscribes to every stream; it only reads |
//! | `dashboard` | what is known, and the one view of it that everything below draws |
//! | `history`, `event_log` | last seconds, last events |
//! | `commander` | name of the process that commands |
//! | `last_run` | why a controller has ended that is not there any more |
//! | `once` | reasons with what to do, and everything else once |
//! | `lines` | lines of text |
//! | `terminal` | the screen with keys; only its `operator_commands` sends requests |
//! | `web` | the page; it holds a dashboard and no client |
//!
//! The control loop notices none of it: a subscriber that is slow loses the oldest messages, and
//! the loop never waits.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod commander;
mod dashboard;
mod event_log;
mod history;
mod last_run;
mod lines;
mod once;
mod subscriptions;
mod terminal;
mod web;

use std::io::{self, IsTerminal};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::units::Nanos;

use clap::Parser;
use dashboard::Dashboard;
use i2ris_report::exit::Coded;
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, model_poller, until_closed};
use std::process::ExitCode;
use subscriptions::{READ_PERIOD, Subscriptions};

/// Time to wait for a controller that is starting.
const CONNECT: Nanos = Nanos::from_millis(2000);
/// Time between two lines in a file.
const LINE_PERIOD: Nanos = Nanos::from_millis(1000);

/// Say why the robot does not move, and what to do; watch it
#[derive(Debug, Parser)]
#[command(name = "i2ris-status", bin_name = "i2ris status", version, propagate_version = true)]
#[command(after_help = "Examples:
  i2ris status                      why it does not move, what to do, and everything once
  i2ris status --watch              the screen, with keys to stop the robot and to change its model
  i2ris status --watch | head       one line a second
  i2ris status --web                a read-only page: http://127.0.0.1:8765/
  i2ris status --web 8080           the same on another port

What keeps the robot from moving now comes first, then the last refusals, stops and clips with their \
age. Two lines each: code, sentence, measured value and limit; and what to do.

Exit codes: 0 ended as asked, 2 wrong arguments, 3 no controller (except --web, which waits for \
one).")]
struct Arguments {
    #[command(flatten)]
    domain: DomainOption,
    /// Print JSON
    #[arg(long, conflicts_with_all = ["watch", "web"])]
    json: bool,
    /// Go on: a screen on a terminal, or one line a second
    #[arg(long, conflicts_with = "web")]
    watch: bool,
    /// With --watch or --web: end after this time instead of with Ctrl-C
    #[arg(long, value_name = "S")]
    duration_s: Option<f64>,
    /// Serve a read-only page for a browser at PORT, ADDRESS or ADDRESS:PORT
    #[arg(
        long,
        value_name = "ADDR",
        num_args = 0..=1,
        default_missing_value = web::DEFAULT_ADDRESS
    )]
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
    let mut client = Client::connect(&domain, CONNECT).map_err(|error| {
        let last = Some(&domain).filter(|_| error.is_absent()).and_then(last_run::sentence);
        match last {
            Some(last) => Coded { code: 3, sentence: format!("{error}; {last}") }.into(),
            None => Failure::from(error),
        }
    })?;
    let version = client.version()?;
    let title = model_poller::title(&version, domain.name(), version.model_id);
    drop(client);
    let mut subscriptions = Subscriptions::new(&domain);
    if !arguments.watch {
        return once::run(&domain, &mut subscriptions, &title, arguments.json);
    }
    if io::stdout().is_terminal() && io::stdin().is_terminal() {
        return terminal::run(&domain, subscriptions, title, span);
    }
    let interrupt = Interrupt::catch()?;
    plain(&mut subscriptions, &interrupt, span)
}

/// A line a second, into a file, a pipe, or a terminal without a keyboard.
fn plain(
    subscriptions: &mut Subscriptions,
    interrupt: &Interrupt,
    span: Option<Nanos>,
) -> Result<(), Failure> {
    let start = clock::now();
    let (mut screen, mut dashboard) = (Screen::stdout(), Dashboard::default());
    let (mut next_line, mut open) = (start + READ_PERIOD + READ_PERIOD, true);
    while open
        && !interrupt.came()
        && span.is_none_or(|span| clock::now().duration_since(start) < span)
    {
        let now = clock::now();
        subscriptions.refresh(&mut dashboard, now);
        if now >= next_line {
            next_line = now + LINE_PERIOD;
            let problem = dashboard.problem.clone();
            open = until_closed(
                screen.say(&problem.unwrap_or_else(|| lines::line(&dashboard.view(now)))),
            )?;
        }
        clock::sleep(READ_PERIOD);
    }
    Ok(())
}
