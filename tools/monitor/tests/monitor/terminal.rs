//! `i2ris status` on a terminal: what it shows at every size, what its keys do, and how it leaves
//! the terminal.

use std::fs::File;
use std::io::Read;
use std::os::fd::OwnedFd;
use std::os::unix::fs::OpenOptionsExt;

use i2ris::clock;
use i2ris::ipc::{Fault, ModelAction, OperatingState, StateCommand};
use i2ris_testing::{Controller, Terminal, program, wait_for_end};
use nix::fcntl::OFlag;
use nix::pty::{grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::signal::{Signal, kill};

const KEYS: [&str; 9] = [
    "space pause",
    "s stop",
    "a acknowledge",
    "m swap model",
    "b roll back",
    "tab next view",
    "1-5 view",
    "scroll",
    "q quit",
];

#[test]
fn forty_columns_hold_every_number_and_every_key() {
    let controller = Controller::enabled();
    let mut terminal = Terminal::start(&controller.domain, &["status", "--watch"], 40, 40);
    let text = terminal
        .wait("everything", |text| text.contains("SCHEDULING") && text.contains("previous none"));
    let parts = [
        "ENABLED",
        "homed",
        "memory unknown",
        "no commander",
        "accepted 0",
        "refused 0",
        "deg",
        "pitch   +1.00  +1.00  +1.00  0.00      -",
        "  0       40       40    0 starting",
        "bus",
        "late",
        "p50",
    ];
    for part in parts.into_iter().chain(KEYS) {
        assert!(text.contains(part), "{part}\n{text}");
    }
    for (key, shown) in [
        ("2", "pitch, deg"),
        ("3", "pitch over yaw"),
        ("4", "motor 0"),
        ("5", "events seen"),
        ("1", "setpt."),
    ] {
        terminal.type_keys(key);
        let text = terminal.wait_for(shown);
        assert!(text.contains("ENABLED"), "the state is on every view\n{text}");
    }
}

#[test]
fn a_screen_that_is_too_small_says_what_is_missing_and_one_that_is_large_shows_everything() {
    let controller = Controller::enabled();
    let mut terminal = Terminal::start(&controller.domain, &["status", "--watch"], 16, 40);
    let first =
        terminal.wait("a hint", |text| text.contains("lines 1 to") && text.contains("ENABLED"));
    assert!(!first.contains("SCHEDULING"), "{first}");
    terminal.type_keys("\u{1b}[B\u{1b}[B\u{1b}[B");
    terminal.wait_for("lines 4 to");
    for (rows, columns) in [(3, 10), (1, 1), (8, 200), (60, 20)] {
        terminal.resize(rows, columns);
        clock::sleep(i2ris::units::Nanos::from_millis(300));
    }
    terminal.resize(50, 160);
    for part in [
        "yaw, deg",
        "pitch, deg",
        "pitch over yaw",
        "motor 0",
        "motor 1",
        "events seen",
        "setpt.",
        "q quit",
        "━ estimate",
    ] {
        terminal.wait_for(part);
    }
}

#[test]
fn keys_stop_the_robot_and_acknowledge_its_faults() {
    let controller = Controller::enabled();
    let mut terminal = Terminal::start(&controller.domain, &["status", "--watch"], 40, 60);
    terminal.wait_for("ENABLED");
    terminal.type_keys("s");
    terminal.wait_for("stop: the robot is ENABLED, holds still");
    terminal.type_keys(" ");
    terminal.wait_for("pause: the controller is PAUSED");
    terminal.wait_for(" PAUSED ");
    terminal.type_keys("a");
    terminal.wait_for("acknowledge NOT DONE");
    controller.robot().state = OperatingState::Fault;
    controller.robot().fault = Fault::Link;
    terminal.wait_for("a drive does not answer");
    terminal.type_keys("a");
    terminal.wait_for("acknowledge: the controller is DISABLED");
    let asked = controller.robot().asked.clone();
    assert_eq!(
        asked,
        [
            StateCommand::Hold,
            StateCommand::Pause,
            StateCommand::Acknowledge,
            StateCommand::Acknowledge
        ]
    );
    terminal.type_keys("5");
    let text = terminal.wait_for("PAUSED to FAULT: a drive does not");
    assert!(text.contains("pause: the controller is PAUSED"), "{text}");
}

#[test]
fn a_model_is_changed_only_after_a_confirmation() {
    let controller = Controller::enabled();
    controller.robot().models = [1, 0, 0];
    let mut terminal = Terminal::start(&controller.domain, &["status", "--watch"], 45, 60);
    terminal.wait_for("in use linear 01010101");
    terminal.type_keys("my");
    terminal.wait_for("no model is staged");
    controller.robot().models = [1, 2, 0];
    terminal.wait_for("staged linear 02020202");
    terminal.type_keys("m");
    let text = terminal.wait_for("Activate linear 02020202 in place of linear 01010101?");
    assert!(text.contains("y yes") && text.contains("n no"), "{text}");
    terminal.type_keys("n");
    terminal.wait("the question is gone", |text| !text.contains("Activate"));
    assert!(controller.robot().asked_of_models.is_empty());
    terminal.type_keys("my");
    terminal.wait_for("swap: model 02020202 takes over");
    terminal.wait_for("previous linear 01010101");
    terminal.type_keys("b");
    terminal.wait_for("Roll back to linear 01010101?");
    terminal.type_keys("y");
    terminal.wait_for("roll back: model 01010101 takes over");
    assert_eq!(controller.robot().asked_of_models, [ModelAction::Activate, ModelAction::Rollback]);
}

#[test]
fn the_terminal_is_put_back_by_q_and_by_signals() {
    let controller = Controller::enabled();
    for end in [None, Some(Signal::SIGINT), Some(Signal::SIGTERM)] {
        let mut terminal = Terminal::start(&controller.domain, &["status", "--watch"], 24, 80);
        terminal.wait_for("ENABLED");
        assert!(terminal.is_raw() && terminal.screen.screen().alternate_screen());
        match end {
            None => terminal.type_keys("q"),
            Some(signal) => kill(terminal.pid(), signal).unwrap(),
        }
        assert!(terminal.end().success(), "{end:?}");
        terminal.assert_restored();
    }
    assert!(controller.robot().asked.is_empty(), "looking asks for nothing");
}

/// A terminal that is gone reads as its end for ever.
#[test]
fn a_terminal_that_is_gone_ends_it_without_a_signal() {
    let controller = Controller::enabled();
    // Closed in every child: one that had it would keep the terminal there.
    let flags = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC;
    let master = posix_openpt(flags).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let mut options = File::options();
    options.read(true).write(true).custom_flags(OFlag::O_NOCTTY.bits());
    let slave = options.open(ptsname_r(&master).unwrap()).unwrap();
    let mut command = program::command(&["status", "--watch"]);
    command.env("I2RIS_DOMAIN", controller.domain.name()).env("TERM", "xterm-256color");
    command.stdin(slave.try_clone().unwrap()).stdout(slave.try_clone().unwrap());
    let mut child = command.stderr(slave).spawn().unwrap();
    drop(command);
    let mut screen = File::from(OwnedFd::from(master));
    // It draws, so it has the terminal.
    screen.read_exact(&mut [0; 512]).unwrap();
    drop(screen);
    wait_for_end(&mut child);
}

#[test]
fn a_controller_that_goes_leaves_old_numbers_that_say_how_old_they_are() {
    let controller = Controller::enabled();
    let domain = controller.domain.clone();
    let mut terminal = Terminal::start(&domain, &["status", "--watch"], 45, 60);
    terminal.wait_for("+1.00");
    drop(controller);
    let text = terminal
        .wait("staleness", |text| text.contains("was ENABLED") && text.contains("estimate STALE"));
    assert!(text.contains("no controller serves domain") && text.contains("motor"), "{text}");
    terminal.type_keys(" ");
    terminal.wait_for("pause NOT DONE: no controller serves domain");
    terminal.type_keys("q");
    assert!(terminal.end().success());
}

#[test]
fn the_line_with_process_and_model_follows_the_controller() {
    let controller = Controller::enabled();
    let mut terminal = Terminal::start(&controller.domain, &["status", "--watch"], 50, 140);
    let process = format!("process {}, model", std::process::id());
    terminal.wait("the first model", |text| text.contains(&format!("{process} 01010101")));
    controller.robot().models = [7, 0, 1];
    terminal.wait("the second model", |text| text.contains(&format!("{process} 07070707")));
}
