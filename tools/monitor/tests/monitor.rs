//! `i2ris status` against a controller without drives.
#![allow(clippy::unwrap_used)]

#[path = "monitor/chromium.rs"]
mod chromium;
#[path = "monitor/contrast.rs"]
mod contrast;
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

use std::io::{BufRead, BufReader, Read};

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
fn a_controller_that_went_away_is_told_not_hidden() {
    let controller = Controller::enabled();
    let mut program = Program::start(&controller.domain, &["status", "--watch"]);
    let mut lines = BufReader::new(program.child().stdout.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().starts_with("ENABLED"));
    drop(controller);
    assert!(lines.any(|line| line.unwrap().contains("no controller serves domain")));
    program.interrupt();
    assert!(program.end().0);
}

#[test]
fn on_a_terminal_the_page_is_drawn_over_again() {
    let controller = Controller::enabled();
    let pty = nix::pty::openpty(None, None).unwrap();
    let mut child = i2ris_testing::program::command(&["status", "--watch", "--duration-s", "2.5"])
        .env("I2RIS_DOMAIN", controller.domain.name())
        .stdin(std::process::Stdio::null())
        .stdout(pty.slave)
        .spawn()
        .unwrap();
    // Reading ends with an error once the last writer has closed the other end.
    let mut text = Vec::new();
    let _ = std::fs::File::from(pty.master).read_to_end(&mut text);
    assert!(child.wait().unwrap().success());
    let text = String::from_utf8(text).unwrap();
    let pages = text.matches("real time  ").count();
    assert!(pages >= 2, "{text}");
    // Every page but the first goes up over the one before, as far as that was long.
    let lines = text.split("\u{1b}[J").next().unwrap().lines().count();
    assert_eq!(text.matches(&format!("\u{1b}[{lines}A")).count(), pages - 1, "{text}");
}
