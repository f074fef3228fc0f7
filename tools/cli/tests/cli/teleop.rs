//! Leading by hand: a gamepad played by a pipe in the form of the kernel's joystick events, a
//! keyboard by a pseudo-terminal.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::payload::ServoJp;
use i2ris::units::Nanos;
use i2ris_testing::{Controller, Terminal};
use nix::sys::stat::Mode;

use crate::bench::{Bench, ends, fails, start};
use crate::command::{assert_near, assert_no_jump};

const DEAD_MAN: u8 = 5;
const BUTTON: u8 = 1;
const AXIS: u8 = 2;
const SIDE: u8 = 0;

/// A pipe that a program takes for a gamepad.
struct Pad {
    bench: Bench,
    file: Option<File>,
}

impl Pad {
    fn new() -> Self {
        let bench = Bench::new();
        let path = bench.path("js0");
        nix::unistd::mkfifo(&path, Mode::S_IRUSR | Mode::S_IWUSR).unwrap();
        // Reading as well, so that opening does not wait for the program.
        let mut options = OpenOptions::new();
        options.read(true).write(true).custom_flags(nix::libc::O_NONBLOCK);
        Self { bench, file: Some(options.open(&path).unwrap()) }
    }

    fn play(&mut self, kind: u8, number: u8, value: i16) {
        let [low, high] = value.to_le_bytes();
        self.file.as_mut().unwrap().write_all(&[0, 0, 0, 0, low, high, kind, number]).unwrap();
    }

    fn unplug(&mut self) {
        self.file = None;
    }
}

fn clutch_is_open(flags: u32) -> bool {
    flags & ServoJp::CLUTCH != 0
}

/// Where the snake is, and after how many commands.
fn place(controller: &Controller) -> ([f64; 2], usize) {
    let robot = controller.robot();
    (robot.pose, robot.poses.len())
}

#[test]
fn a_gamepad_steers_while_its_dead_man_is_held_and_the_snake_holds_when_it_is_unplugged() {
    let controller = Controller::enabled();
    let mut pad = Pad::new();
    let words = format!("command --gamepad {} --speed-deg-s 20 --scale 0.5", pad.bench.file("js0"));
    let program = start(&controller.domain, &words);
    pad.play(AXIS, SIDE, 32767);
    controller.wait("commands with an open clutch", |robot| robot.poses.len() > 50);
    assert!(clutch_is_open(controller.robot().flags));
    assert_near(controller.robot().pose, [1.0, -1.0]);
    pad.play(BUTTON, DEAD_MAN, 1);
    controller.wait("motion to the side", |robot| robot.pose[1] > 1.0);
    assert!(!clutch_is_open(controller.robot().flags));
    pad.play(BUTTON, DEAD_MAN, 0);
    controller.wait("the clutch", |robot| clutch_is_open(robot.flags));
    let (there, count) = place(&controller);
    controller.wait("more commands", |robot| robot.poses.len() > count + 50);
    assert_near(controller.robot().pose, there);
    // Pulled out in motion.
    pad.play(BUTTON, DEAD_MAN, 1);
    controller.wait("motion again", |robot| robot.pose[1] > there[1] + 1.0);
    pad.unplug();
    ends(program, 1, &["js0 is gone", "the snake holds"]);
    let robot = controller.robot();
    assert!(clutch_is_open(robot.flags), "the last command opens the clutch");
    assert_eq!((robot.lease, robot.asked.last()), (0, Some(&StateCommand::Release)));
    assert!((robot.pose[0] - 1.0).abs() < 1e-6, "the other axis stood still");
    // Half of 20 deg/s.
    assert_no_jump(&robot.poses, 10.0);
}

#[test]
fn keys_steer_after_the_space_bar_and_a_second_without_one_opens_the_clutch() {
    let controller = Controller::enabled();
    let words = ["command", "--keyboard", "--step-deg", "0.5"];
    let mut terminal = Terminal::start(&controller.domain, &words, 24, 80);
    controller.wait("commands", |robot| robot.poses.len() > 20);
    for _ in 0..5 {
        terminal.type_keys("\x1b[C");
        clock::sleep(Nanos::from_millis(20));
    }
    assert_near(controller.robot().pose, [1.0, -1.0]);
    terminal.type_keys(" ");
    controller.wait("a closed clutch", |robot| !clutch_is_open(robot.flags));
    for _ in 0..10 {
        terminal.type_keys("\x1b[C");
        clock::sleep(Nanos::from_millis(40));
    }
    controller.wait("motion to the right", |robot| robot.pose[1] > 0.0);
    terminal.wait_for("FOLLOWS");
    controller.wait("the dead-man", |robot| clutch_is_open(robot.flags));
    let (there, count) = place(&controller);
    terminal.type_keys("\x1b[C\x1b[C");
    controller.wait("more commands", |robot| robot.poses.len() > count + 50);
    assert_near(controller.robot().pose, there);
    let shown = terminal.wait_for("HOLDS");
    assert!(shown.contains("Space closes the clutch"), "{shown}");
    terminal.type_keys("q");
    assert!(terminal.end().success());
    terminal.assert_restored();
    let robot = controller.robot();
    assert_eq!((robot.lease, robot.asked.last()), (0, Some(&StateCommand::Release)));
    assert_no_jump(&robot.poses, 10.0);
}

#[test]
fn devices_that_are_none_and_two_masters_at_once_are_refused() {
    let controller = Controller::enabled();
    for (words, code, parts) in [
        ("--gamepad /nonexistent/js7", 1, &["/nonexistent/js7", "ls /dev/input/js*"][..]),
        ("--keyboard", 1, &["needs a terminal"]),
        ("--keyboard hold", 2, &["not both"]),
        ("--keyboard --gamepad", 2, &["cannot be used with"]),
    ] {
        fails(&controller.domain, &format!("command {words}"), code, parts);
    }
    assert!(controller.robot().poses.is_empty());
}
