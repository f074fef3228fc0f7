//! `i2ris status` against a controller without drives.
#![allow(clippy::unwrap_used)]

mod http;
mod pages;
mod web;

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::os::fd::OwnedFd;
use std::os::unix::fs::OpenOptionsExt;

use i2ris::ipc::OperatingState;
use i2ris_testing::bench::{assert_says, fails, succeeds};
use i2ris_testing::{Controller, Program, Terminal, program, unique_domain, wait_for_end};
use nix::fcntl::OFlag;
use nix::pty::{grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::signal::{Signal, kill};

#[test]
fn missing_controller_is_reported() {
    fails(&unique_domain(), "status --watch", 3, &["no controller serves domain"]);
}

#[test]
fn without_options_it_shows_everything_once() {
    let controller = Controller::enabled();
    let output = succeeds(&controller.domain, "status");
    let parts = ["ENABLED", "homed", "+1.00", "-1.00", "motor 1", "loop", "real time"];
    assert_says(&output, &[&parts[..], &[controller.domain.name()]].concat());
    assert!(!output.contains('\u{1b}'), "no control characters into a file");
}

#[test]
fn watching_prints_the_same_text_every_second() {
    let controller = Controller::enabled();
    let once = succeeds(&controller.domain, "status");
    let output = succeeds(&controller.domain, "status --watch --duration-s 3.5");
    let prints = output.matches("state      ENABLED").count();
    assert!((2..=4).contains(&prints), "{output}");
    // Numbers change from one to the next, words do not.
    let words = |text: &str| text.replace(|c: char| !c.is_ascii_alphabetic(), "");
    assert_eq!(words(&output), words(&once).repeat(prints));
    assert!(!output.contains('\u{1b}'), "no control characters into a file");
}

#[test]
fn watching_ends_cleanly_with_ctrl_c_and_with_its_reader() {
    let controller = Controller::enabled();
    let mut interrupted = Program::start(&controller.domain, &["status", "--watch"]);
    let mut lines = BufReader::new(interrupted.child().stdout.take().unwrap()).lines();
    for _ in 0..2 {
        assert!(lines.any(|line| line.unwrap().starts_with("state      ENABLED")));
    }
    interrupted.interrupt();
    let (code, _, error) = interrupted.code();
    assert!(code == Some(0) && error.is_empty(), "{code:?} {error}");

    let mut deserted = Program::start(&controller.domain, &["status", "--watch"]);
    drop(deserted.child().stdout.take());
    let (success, _, error) = deserted.end();
    assert!(success && error.is_empty(), "{error}");
    assert!(controller.robot().requested.is_empty(), "watching sends no requests");
}

#[test]
fn watching_outlives_a_controller_and_follows_the_next_one() {
    let controller = Controller::enabled();
    let domain = controller.domain.clone();
    let mut program = Program::start(&domain, &["status", "--watch"]);
    let mut lines = BufReader::new(program.child().stdout.take().unwrap()).lines();
    let mut wait_for = |start: &str| assert!(lines.any(|it| it.unwrap().starts_with(start)));
    wait_for("state      ENABLED");
    let controller = controller.restart_after(|| {
        let (_, _, error) = Program::run(&domain, &["status"]);
        // The rest names other domains, which come and go.
        wait_for(error.trim_start_matches("error: ").split(';').next().unwrap());
    });
    controller.robot().state = OperatingState::Paused;
    wait_for("i2ris 0.");
    wait_for("state      PAUSED");
    program.interrupt();
    assert!(program.end().0);
}

#[test]
fn each_print_on_a_terminal_replaces_the_previous_one() {
    let controller = Controller::enabled();
    let mut terminal = Terminal::start(&controller.domain, &["status", "--watch"], 40, 100);
    terminal.wait_for("ENABLED");
    controller.robot().state = OperatingState::Paused;
    let text = terminal.wait_for("PAUSED");
    assert!(!text.contains("ENABLED") && text.matches("commander ").count() == 1, "{text}");
    kill(terminal.pid(), Signal::SIGINT).unwrap();
    assert!(terminal.end().success());
    terminal.assert_restored();
}

/// Without input and without a signal.
#[test]
fn closed_terminal_ends_it_without_a_signal() {
    let controller = Controller::enabled();
    // Closed in every child: an open copy would keep the terminal alive.
    let flags = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC;
    let master = posix_openpt(flags).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let mut options = File::options();
    options.read(true).write(true).custom_flags(OFlag::O_NOCTTY.bits());
    let slave = options.open(ptsname_r(&master).unwrap()).unwrap();
    let mut command = program::command(&["status", "--watch"]);
    command.env("I2RIS_DOMAIN", controller.domain.name());
    command.stdin(slave.try_clone().unwrap()).stdout(slave.try_clone().unwrap());
    let mut child = command.stderr(slave).spawn().unwrap();
    drop(command);
    let mut screen = File::from(OwnedFd::from(master));
    // It prints, so it has the terminal.
    screen.read_exact(&mut [0; 64]).unwrap();
    drop(screen);
    wait_for_end(&mut child);
}
