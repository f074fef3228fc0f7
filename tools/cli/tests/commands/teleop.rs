//! Leading by hand: a gamepad played by a pipe in the form of the kernel's joystick events, a
//! keyboard by a pseudo-terminal.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread;

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::payload::ServoJp;
use i2ris::units::Nanos;
use nix::pty::openpty;
use nix::sys::stat::Mode;
use tempfile::TempDir;

use crate::command::{assert_near, assert_no_jump};
use i2ris_testing::{Controller, Program};

const DEAD_MAN: u8 = 5;
const BUTTON: u8 = 1;
const AXIS: u8 = 2;
const SIDE: u8 = 0;

/// A pipe that a program takes for a gamepad.
struct Pad {
    _folder: TempDir,
    path: PathBuf,
    file: Option<File>,
}

impl Pad {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("js0");
        nix::unistd::mkfifo(&path, Mode::S_IRUSR | Mode::S_IWUSR).unwrap();
        // Reading as well, so that opening does not wait for the program.
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(nix::libc::O_NONBLOCK)
            .open(&path)
            .unwrap();
        Self { _folder: folder, path, file: Some(file) }
    }

    fn play(&mut self, kind: u8, number: u8, value: i16) {
        let [low, high] = value.to_le_bytes();
        self.file.as_mut().unwrap().write_all(&[0, 0, 0, 0, low, high, kind, number]).unwrap();
    }

    fn unplug(&mut self) {
        self.file = None;
    }
}

fn lead(controller: &Controller, pad: &Pad) -> Program {
    let arguments = [
        "command",
        "--gamepad",
        pad.path.to_str().unwrap(),
        "--speed-deg-s",
        "20",
        "--scale",
        "0.5",
    ];
    Program::start(&controller.domain, &arguments)
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
    let program = lead(&controller, &pad);
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
    let (success, _, error) = program.end();
    assert!(
        !success && error.contains("js0 is gone") && error.contains("the snake holds"),
        "{error}"
    );
    let robot = controller.robot();
    assert!(clutch_is_open(robot.flags), "the last command opens the clutch");
    assert_eq!((robot.lease, robot.asked.last()), (0, Some(&StateCommand::Release)));
    assert!((robot.pose[0] - 1.0).abs() < 1e-6, "the other axis stood still");
    // Half of 20 deg/s.
    assert_no_jump(&robot.poses, 10.0);
}

#[test]
fn a_gamepad_that_is_not_there_is_named() {
    let controller = Controller::enabled();
    let (success, _, error) =
        Program::run(&controller.domain, &["command", "--gamepad", "/nonexistent/js7"]);
    assert!(
        !success && error.contains("/nonexistent/js7") && error.contains("ls /dev/input/js*"),
        "{error}"
    );
}

#[test]
fn keys_steer_after_the_space_bar_and_a_second_without_one_opens_the_clutch() {
    let controller = Controller::enabled();
    let terminal = openpty(None, None).unwrap();
    let mut program = Command::new(env!("CARGO_BIN_EXE_i2ris"))
        .args(["command", "--keyboard", "--step-deg", "0.5", "--domain", controller.domain.name()])
        .stdin(Stdio::from(terminal.slave.try_clone().unwrap()))
        .stdout(Stdio::from(terminal.slave))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut keys = File::from(terminal.master);
    let mut screen = keys.try_clone().unwrap();
    let shown = thread::spawn(move || {
        let (mut text, mut buffer) = (Vec::new(), [0; 4096]);
        // The end of the program is an error on this side.
        while let Ok(length @ 1..) = screen.read(&mut buffer) {
            text.extend(&buffer[..length]);
        }
        String::from_utf8_lossy(&text).into_owned()
    });
    controller.wait("commands", |robot| robot.poses.len() > 20);
    for _ in 0..5 {
        keys.write_all(b"\x1b[C").unwrap();
        clock::sleep(Nanos::from_millis(20));
    }
    assert_near(controller.robot().pose, [1.0, -1.0]);
    keys.write_all(b" ").unwrap();
    controller.wait("a closed clutch", |robot| !clutch_is_open(robot.flags));
    for _ in 0..10 {
        keys.write_all(b"\x1b[C").unwrap();
        clock::sleep(Nanos::from_millis(40));
    }
    controller.wait("motion to the right", |robot| robot.pose[1] > 0.0);
    controller.wait("the dead-man", |robot| clutch_is_open(robot.flags));
    let (there, count) = place(&controller);
    keys.write_all(b"\x1b[C\x1b[C").unwrap();
    controller.wait("more commands", |robot| robot.poses.len() > count + 50);
    assert_near(controller.robot().pose, there);
    keys.write_all(b"q").unwrap();
    assert!(program.wait().unwrap().success());
    let text = shown.join().unwrap();
    assert!(
        text.contains("Space closes the clutch")
            && text.contains("FOLLOWS")
            && text.contains("HOLDS"),
        "{text}"
    );
    let robot = controller.robot();
    assert_eq!((robot.lease, robot.asked.last()), (0, Some(&StateCommand::Release)));
    assert_no_jump(&robot.poses, 10.0);
}

#[test]
fn a_keyboard_that_is_none_and_two_masters_at_once_are_refused() {
    let controller = Controller::enabled();
    let (success, _, error) = Program::run(&controller.domain, &["command", "--keyboard"]);
    assert!(!success && error.contains("needs a terminal"), "{error}");
    let (success, _, error) = Program::run(&controller.domain, &["command", "--keyboard", "hold"]);
    assert!(!success && error.contains("not both"), "{error}");
    let (success, _, error) =
        Program::run(&controller.domain, &["command", "--keyboard", "--gamepad"]);
    assert!(!success && error.contains("cannot be used with"), "{error}");
    assert!(controller.robot().poses.is_empty());
}
