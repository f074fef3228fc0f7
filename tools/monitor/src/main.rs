//! `i2ris monitor`: shows what the controller tells, as a screen, as lines, or as a page for a
//! browser.
//!
//! | part | does |
//! |---|---|
//! | `sight` | subscribes to every stream; reads, and cannot move anything |
//! | `board`, `view`, `trail`, `journal`, `models`, `hull` | what is shown: last messages, last seconds, last events, models |
//! | `terminal` | the screen with keys; its `hands` are the only part that asks the controller to do something |
//! | `web` | the page; holds a board and no client at all |
//!
//! The control loop notices none of it: a subscriber that is slow loses the oldest messages, and
//! the loop never waits.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command-line program prints"
)]

mod board;
mod hull;
mod journal;
mod models;
mod sight;
mod terminal;
mod trail;
mod view;
mod web;

use std::io::{self, IsTerminal};
use std::path::PathBuf;

use i2ris::clock;
use i2ris::ipc::client::{Client, Watcher};
use i2ris::units::Nanos;

use board::Board;
use clap::Parser;
use i2ris_terminal::Failure;
use i2ris_terminal::{DomainOption, Interrupt, Screen, until_closed};
use sight::{READ_PERIOD, Sight};
use std::process::ExitCode;

/// How long to wait for a controller that is just starting.
const CONNECT: Nanos = Nanos::from_millis(2000);
/// How often a person sees something new, and how often a file gets a line.
const DRAW_PERIOD: Nanos = Nanos::from_millis(100);
const LINE_PERIOD: Nanos = Nanos::from_millis(1000);
/// Statistics come once a second: what is not there by then will not come.
const FIRST_NEWS: Nanos = Nanos::from_millis(1500);

/// Watch the robot
#[derive(Debug, Parser)]
#[command(
    name = "i2ris-monitor",
    bin_name = "i2ris monitor",
    version,
    propagate_version = true
)]
#[command(after_help = "Examples:
  i2ris monitor                     the screen, with keys to stop the robot and to change its model
  i2ris monitor --web               a page to look at: http://127.0.0.1:8765/
  i2ris monitor --web 8080          the same on another port
  i2ris monitor | head              one line a second

Exit codes: 0 ended as asked, 1 no controller (except --web, which waits for one), 2 wrong arguments.")]
struct Arguments {
    #[command(flatten)]
    domain: DomainOption,
    /// Show everything once and end
    #[arg(long, conflicts_with = "web")]
    once: bool,
    /// End after this time instead of with Ctrl-C
    #[arg(long = "duration-s", visible_alias = "duration", value_name = "S")]
    duration_s: Option<f64>,
    /// Serve a page for a browser, to look at only, at PORT, ADDRESS or ADDRESS:PORT
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = web::DEFAULT_ADDRESS)]
    web: Option<web::Place>,
    /// The file of the model in use, for its hull, where it is not where the controller says
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
}

fn main() -> ExitCode {
    i2ris_terminal::program::run(|_| false, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    let domain = arguments.domain.domain()?;
    let span = arguments
        .duration_s
        .map(|seconds| Nanos((seconds.max(0.0) * 1e9) as u64));
    if let Some(place) = arguments.web {
        return web::run(&domain, place, arguments.model, span);
    }
    let mut client = Client::connect(&domain, CONNECT)?;
    let title = title(&mut client, domain.name())?;
    drop(client);
    let mut sight = Sight::new(&Watcher::new(&domain));
    if !arguments.once && io::stdout().is_terminal() && io::stdin().is_terminal() {
        return terminal::run(&domain, sight, title, arguments.model, span);
    }
    let interrupt = Interrupt::catch()?;
    if arguments.once {
        return once(&mut sight, &interrupt, title);
    }
    plain(&mut sight, &interrupt, &title, span)
}

/// Lines into a file or a pipe; the same page again and again on a terminal that has no keyboard.
fn plain(
    sight: &mut Sight,
    interrupt: &Interrupt,
    title: &str,
    span: Option<Nanos>,
) -> Result<(), Failure> {
    let start = clock::now();
    let (mut screen, mut board) = (Screen::stdout(), Board::default());
    let period = if screen.is_terminal() {
        DRAW_PERIOD
    } else {
        LINE_PERIOD
    };
    let (mut next_draw, mut open) = (start + READ_PERIOD + READ_PERIOD, true);
    while open && !interrupt.came() && span.is_none_or(|span| clock::now().since(start) < span) {
        let now = clock::now();
        sight.refresh(&mut board, now);
        if now >= next_draw {
            next_draw = now + period;
            open = until_closed(screen.draw(&lines(&board, &screen, title, now)))?;
        }
        clock::sleep(READ_PERIOD);
    }
    Ok(())
}

fn lines(board: &Board, screen: &Screen, title: &str, now: Nanos) -> Vec<String> {
    match &board.problem {
        Some(problem) => vec![problem.clone()],
        None if screen.is_terminal() => [vec![title.to_owned()], board.view.page(now)].concat(),
        None => vec![board.view.line(now)],
    }
}

/// Waits until every stream that a controller always tells has told something, then shows the page.
fn once(sight: &mut Sight, interrupt: &Interrupt, title: String) -> Result<(), Failure> {
    let start = clock::now();
    let mut board = Board::default();
    loop {
        let now = clock::now();
        sight.refresh(&mut board, now);
        if let Some(problem) = board.problem {
            return Err(problem.into());
        }
        if board.view.is_complete() || now.since(start) > FIRST_NEWS || interrupt.came() {
            let page = [vec![title], board.view.page(now)].concat();
            until_closed(Screen::stdout().draw(&page))?;
            return Ok(());
        }
        clock::sleep(Nanos::from_millis(5));
    }
}

fn title(client: &mut Client, domain: &str) -> Result<String, Failure> {
    let version = client.version()?;
    let [major, minor, patch] = version.software;
    let model: String = match version.model_id {
        [0, ..] if version.model_id == [0; 32] => "no model".to_owned(),
        id => format!("model {}", view::short_id(i2ris::model::ModelId(id))),
    };
    Ok(format!(
        "i2ris {major}.{minor}.{patch}, domain {domain}, process {}, {model}",
        version.pid
    ))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_help_has_an_example_and_the_command_line_is_consistent() {
        let mut command = Arguments::command();
        let help = command.render_long_help().to_string();
        assert!(
            help.contains("Example") && help.contains("i2ris monitor"),
            "{help}"
        );
        command.debug_assert();
    }
}
