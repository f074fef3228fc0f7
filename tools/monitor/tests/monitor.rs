//! `i2ris status` against a controller without drives.
#![allow(clippy::unwrap_used)]

#[path = "monitor/chromium.rs"]
mod chromium;
#[path = "monitor/http.rs"]
mod http;
#[path = "monitor/pages.rs"]
mod pages;
#[path = "monitor/terminal.rs"]
mod terminal;
#[path = "monitor/trial.rs"]
mod trial;
#[path = "monitor/web.rs"]
mod web;

use std::io::{BufRead, BufReader};

use i2ris_testing::{Controller, Program, unique_domain};

#[test]
fn without_a_controller_it_says_so() {
    let (success, _, error) = Program::run(&unique_domain(), &["status", "--watch"]);
    assert!(!success && error.contains("no controller serves domain"), "{error}");
}

#[test]
fn without_options_it_shows_everything_once() {
    let controller = Controller::enabled();
    let (success, output, error) = Program::run(&controller.domain, &["status"]);
    assert!(success, "{error}");
    for part in [
        controller.domain.name(),
        "ENABLED",
        "homed",
        "+1.00",
        "-1.00",
        "motor 1",
        "loop",
        "real time",
    ] {
        assert!(output.contains(part), "{part}\n{output}");
    }
    assert!(!output.contains('\u{1b}'), "no control characters into a file");
}

#[test]
fn into_a_file_goes_one_line_a_second_until_the_time_is_over() {
    let controller = Controller::enabled();
    let (success, output, error) =
        Program::run(&controller.domain, &["status", "--watch", "--duration-s", "1.5"]);
    assert!(success, "{error}");
    let lines: Vec<&str> = output.lines().collect();
    assert!((1..=3).contains(&lines.len()), "{output}");
    assert!(
        lines.iter().all(|line| line.starts_with("ENABLED; goal +1.00 -1.00 setpoint")),
        "{output}"
    );
}

#[test]
fn it_ends_well_with_ctrl_c_and_with_its_reader() {
    let controller = Controller::enabled();
    let mut interrupted = Program::start(&controller.domain, &["status", "--watch"]);
    let mut first = String::new();
    let mut reader = BufReader::new(interrupted.child().stdout.take().unwrap());
    reader.read_line(&mut first).unwrap();
    interrupted.interrupt();
    let (success, _, error) = interrupted.end();
    assert!(success && error.is_empty(), "{error}");

    let mut deserted = Program::start(&controller.domain, &["status", "--watch"]);
    drop(deserted.child().stdout.take());
    let (success, _, error) = deserted.end();
    assert!(success && error.is_empty(), "{error}");
}

#[test]
fn a_controller_that_went_away_is_reported_not_hidden() {
    let controller = Controller::enabled();
    let mut program = Program::start(&controller.domain, &["status", "--watch"]);
    let mut lines = BufReader::new(program.child().stdout.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().starts_with("ENABLED"));
    drop(controller);
    assert!(lines.any(|line| line.unwrap().contains("no controller serves domain")));
    program.interrupt();
    assert!(program.end().0);
}
