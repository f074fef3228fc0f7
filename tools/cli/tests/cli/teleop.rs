//! Teleoperation: recorded devices played through pipes, a keyboard by a
//! pseudo-terminal.

use std::io::{BufRead, BufReader, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::{fs::File, thread};

use i2ris::ipc::client::{Client, ExternalPublisher, Latest};
use i2ris::ipc::payload::{JointState, ServoJp, TeleopMsg};
use i2ris::{clock, ipc::StateCommand, units::Nanos};
use i2ris_teleop::{evdev_decoder::encode, recording, space_mouse, state::Description};
use i2ris_testing::bench::{WorkFolder, assert_says, ends, fails, interrupt, prints, robot, start};
use i2ris_testing::{Controller, TIMEOUT, Terminal, home_and_enable, wait_until};

use crate::command::{assert_near, assert_no_jump};
use crate::played::{AXIS, BTN_EAST, BTN_TR, KEY, KEY_B, Played, X, Y, identity, pad, pedal};

fn clutch_is_open(flags: u32) -> bool {
    flags & ServoJp::CLUTCH != 0
}

fn place(controller: &Controller) -> ([f64; 2], usize) {
    let robot = controller.robot();
    (robot.pose, robot.poses.len())
}

/// Presses the dead-man of a pad, which closes the clutch.
fn grip(controller: &Controller, device: &mut Played) {
    device.send(KEY, BTN_TR, 1);
    controller.wait("a closed clutch", |robot| !clutch_is_open(robot.flags));
}

/// Waits until the program accepts a device again, repeating what `act` does at rest and pressed.
fn wait_until_taken(controller: &Controller, mut act: impl FnMut(bool)) {
    wait_until("it is taken again", || {
        for is_pressed in [false, true] {
            act(is_pressed);
            clock::sleep(Nanos::from_millis(100));
        }
        !clutch_is_open(controller.robot().flags)
    });
}

/// Expects an open clutch, and no motion during fifty more commands.
fn assert_holds(controller: &Controller) -> [f64; 2] {
    controller.wait("the clutch", |robot| clutch_is_open(robot.flags));
    let (there, count) = place(controller);
    controller.wait("more commands", |robot| robot.poses.len() > count + 50);
    assert_near(controller.robot().pose, there);
    there
}

#[test]
fn gamepad_steers_while_dead_man_is_held_and_reconnects() {
    let controller = Controller::enabled();
    let mut device = Played::new(&pad("1"));
    let words = format!("teleop --device {} --speed-deg-s 20 --scale 0.5", device.file());
    let mut program = start(&controller.domain, &words);
    controller.wait("commands with an open clutch", |robot| robot.poses.len() > 50);
    assert_holds(&controller);
    // Held before all controls were seen at rest: a deflected stick must not close the clutch.
    device.send(AXIS, X, 32767);
    device.send(KEY, BTN_TR, 1);
    assert_near(assert_holds(&controller), [1.0, -1.0]);
    device.rest();
    assert_holds(&controller);
    grip(&controller, &mut device);
    device.send(AXIS, X, 32767);
    controller.wait("motion to the side", |robot| robot.pose[1] > 1.0);
    device.send(KEY, BTN_TR, 0);
    let there = assert_holds(&controller);
    // Pulled out in motion.
    device.send(AXIS, X, 0);
    assert_holds(&controller);
    grip(&controller, &mut device);
    device.send(AXIS, X, 32767);
    controller.wait("motion again", |robot| robot.pose[1] > there[1] + 1.0);
    device.unplug();
    assert_holds(&controller);
    // A different device is not accepted; the same one is, once it was seen at rest.
    device.plug_in(&pad("2"));
    device.send(KEY, BTN_TR, 1);
    let there = assert_holds(&controller);
    device.unplug();
    device.plug_in(&pad("1"));
    device.send(AXIS, X, 32767);
    device.send(KEY, BTN_TR, 1);
    assert_near(assert_holds(&controller), there);
    wait_until_taken(&controller, |is_pressed| match is_pressed {
        true => device.send(KEY, BTN_TR, 1),
        false => device.rest(),
    });
    program.interrupt();
    let says = ["is gone (closed); the snake holds", "reconnected at", "+yaw goes → (+0 deg)"];
    prints(program, &says);
    let robot = controller.robot();
    assert!(clutch_is_open(robot.flags), "the last command opens the clutch");
    assert_eq!((robot.lease, robot.requested.last()), (0, Some(&StateCommand::Release)));
    assert!((robot.pose[0] - 1.0).abs() < 1e-6, "the other axis stood still");
    // Half of 20 deg/s.
    assert_no_jump(&robot.poses, 10.0);
}

#[test]
fn losing_space_mouse_or_pedal_opens_the_clutch() {
    let controller = Controller::enabled();
    let mouse_description = space_mouse::description(identity(0x256f, 0xc635, ""));
    let (mut mouse, mut foot) = (Played::new(&mouse_description), Played::new(&pedal()));
    let (files, profile) = ([mouse.file(), foot.file()], mouse.patient_profile());
    let words = format!("teleop --device {} --mode position", files.join(" --device "));
    let program = start(&controller.domain, &format!("{words} --profile {profile}"));
    mouse.report(&[1, 0, 0, 0, 0, 0, 0]);
    controller.wait("commands", |robot| robot.poses.len() > 50);
    // Its own button is ignored if there is a pedal.
    mouse.report(&[3, 1, 0]);
    assert_holds(&controller);
    mouse.report(&[3, 0, 0]);
    foot.send(KEY, KEY_B, 1);
    controller.wait("a closed clutch", |robot| !clutch_is_open(robot.flags));
    // Pushed away from the operator, by its full 350: up, by the reach of 1.5 deg.
    mouse.report(&[1, 0, 0, 0xa2, 0xfe, 0, 0]);
    controller.wait("the whole way", |robot| robot.pose[0] > 2.5 - 1e-6);
    assert_near(controller.robot().pose, [2.5, -1.0]);
    foot.unplug();
    assert_holds(&controller);
    mouse.report(&[1, 0, 0, 0, 0, 0, 0]);
    foot.plug_in(&pedal());
    wait_until_taken(&controller, |is_pressed| foot.send(KEY, KEY_B, is_pressed.into()));
    mouse.unplug();
    assert_holds(&controller);
    interrupt(program);
}

/// An image rotated by 90 deg and mirrored: +pitch is to the right, +yaw is up.
fn show_turned(domain: &i2ris::ipc::Domain, stop: &AtomicBool) {
    let client = Client::connect(domain, TIMEOUT).unwrap();
    let mut setpoint: Latest<JointState> = Latest::new(client.watcher().setpoint_js());
    let mut camera = ExternalPublisher::new(domain);
    while !stop.load(Ordering::Relaxed) {
        if let Some(joint) = setpoint.refresh().unwrap() {
            let [pitch, yaw, _] = joint.position;
            // In payload order: up, then right.
            camera.publish(clock::now(), &[yaw, pitch], &[]).unwrap();
        }
        clock::sleep(Nanos::from_millis(15));
    }
}

#[test]
fn measured_view_aligns_right_and_up() {
    let controller = Controller::enabled();
    let mut device = Played::new(&pad("1"));
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| show_turned(&controller.domain, &stop));
        let words = format!("teleop --device {} --view measure", device.file());
        let mut program = start(&controller.domain, &words);
        controller.wait("the measurement", |robot| robot.poses.len() > 500);
        controller.wait("its end", |robot| clutch_is_open(robot.flags));
        assert_near(assert_holds(&controller), [1.0, -1.0]);
        device.rest();
        assert_holds(&controller);
        grip(&controller, &mut device);
        device.send(AXIS, X, 32767);
        controller.wait("right is +pitch", |robot| robot.pose[0] > 2.0);
        device.send(AXIS, X, 0);
        let pitch = controller.robot().pose[0];
        device.send(AXIS, Y, -32768);
        controller.wait("up is +yaw", |robot| robot.pose[1] > 0.0);
        assert!(controller.robot().pose[0] < pitch + 1.0);
        stop.store(true, Ordering::Relaxed);
        program.interrupt();
        prints(program, &["+pitch goes → (", "+yaw goes ↑ ("]);
    });
}

#[test]
fn without_a_camera_the_view_is_not_measured_and_reported() {
    let controller = Controller::enabled();
    let device = Played::new(&pad("1"));
    let words = format!("teleop --device {} --view measure", device.file());
    fails(&controller.domain, &words, 1, &["0 images", "--view"]);
}

#[test]
fn event_is_published_with_time_and_command_and_button_marks() {
    let controller = Controller::enabled();
    let client = Client::connect(&controller.domain, TIMEOUT).unwrap();
    let mut stream = client.watcher().teleop();
    let mut device = Played::new(&pad("1"));
    let program = start(&controller.domain, &format!("teleop --device {}", device.file()));
    let mut newest = TeleopMsg::default();
    let mut wait = |what: &str, is_so: &dyn Fn(&TeleopMsg) -> bool| {
        wait_until(what, || {
            stream.drain(|message| newest = message).unwrap();
            is_so(&newest)
        });
        newest
    };
    wait("the first message", &|newest| newest.sequence > 0);
    let came = device.report_stamped(AXIS, X, 0);
    let first = wait("the event", &|newest| newest.event_ns == came.0);
    assert!(first.command_sequence > 0 && first.mark_ns == 0);
    let came = device.report_stamped(KEY, BTN_EAST, 1);
    let marked = wait("the mark", &|newest| newest.mark_ns == came.0);
    assert!(marked.event_ns == came.0 && marked.command_sequence > first.command_sequence);
    // Commands stay current, however old the last event is.
    let (_, count) = place(&controller);
    controller.wait("more commands", |robot| robot.poses.len() > count + 50);
    assert!(controller.robot().poses[count + 50].0 > came);
    device.report_stamped(KEY, BTN_EAST, 0);
    interrupt(program);
}

fn own_memory_kib(id: u32) -> i64 {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap();
    line.trim().trim_end_matches(" kB").parse().unwrap()
}

/// An hour of SpaceMouse reports at 125 Hz, as fast as the program reads them.
#[test]
fn hour_of_reports_does_not_grow_memory_or_block_commands() {
    const REPORTS: u32 = 125 * 3600;
    let controller = Controller::enabled();
    let mut mouse = Played::new(&space_mouse::description(identity(0x256f, 0xc635, "")));
    let mut program = start(&controller.domain, &format!("teleop --device {}", mouse.file()));
    controller.wait("commands", |robot| robot.poses.len() > 50);
    let id = program.child().id();
    let (mut warm, mut commands) = (0, 0);
    for number in 0..REPORTS {
        let x = (number % 700) as i16 - 350;
        let [low, high] = x.to_le_bytes();
        let report = match number % 500 {
            100 => vec![3, 1, 0],
            400 => vec![3, 0, 0],
            _ => vec![1, low, high, 0, 0, 0, 0],
        };
        while mouse.try_report(&report).is_err() {
            clock::sleep(Nanos::from_micros(200));
        }
        if number == REPORTS / 10 {
            (warm, commands) = (own_memory_kib(id), place(&controller).1);
        }
    }
    assert!(place(&controller).1 > commands, "a fast device does not delay commands");
    let grown = own_memory_kib(id) - warm;
    assert!(grown < 256, "{grown} KiB more than {warm}");
    interrupt(program);
}

#[test]
fn emulated_snake_follows_device_and_holds_on_its_loss() {
    let (rig, mut client) = robot(|_| ());
    home_and_enable(&mut client, TIMEOUT).unwrap();
    let mut device = Played::new(&pad("1"));
    let program = start(&rig.domain(), &format!("teleop --device {}", device.file()));
    let mut measured = Latest::new(client.watcher().measured_js());
    let mut yaw_deg = || {
        let joint = measured.refresh().unwrap().copied();
        joint.map_or(0.0, |joint| joint.position[1].to_degrees())
    };
    wait_until("it follows", || {
        device.rest();
        clock::sleep(Nanos::from_millis(50));
        device.send(KEY, BTN_TR, 1);
        clock::sleep(Nanos::from_millis(50));
        device.send(AXIS, X, 20_000);
        clock::sleep(Nanos::from_millis(200));
        yaw_deg() > 0.5
    });
    device.unplug();
    clock::sleep(Nanos::from_millis(500));
    let there = yaw_deg();
    clock::sleep(Nanos::from_millis(500));
    assert!((yaw_deg() - there).abs() < 0.1, "{there} {}", yaw_deg());
    interrupt(program);
}

#[test]
fn a_device_is_recorded_played_and_learned() {
    let controller = Controller::enabled();
    let unknown = Description { identity: identity(0x1234, 0xabcd, ""), ..pad("") };
    let mut device = Played::new(&unknown);
    let bench = WorkFolder::empty();
    let (file, profile) = (bench.file("device.input"), bench.file("mine.toml"));
    let played = device.file();
    let unknown_device = ["teleop input learn", "has no profile"];
    fails(&controller.domain, &format!("teleop --device {played}"), 1, &unknown_device);
    device.plug_in(&unknown);
    let words = format!("teleop input record {played} --output {file}");
    let program = start(&controller.domain, &words);
    wait_until("it records", || bench.exists("device.input"));
    device.send(AXIS, X, 32767);
    device.send(KEY, BTN_TR, 1);
    wait_until("the head of the pipe is read", || {
        let frames = recording::read(File::open(bench.path("device.input")).unwrap());
        device.send(AXIS, Y, 0);
        clock::sleep(Nanos::from_millis(20));
        frames.is_ok_and(|(_, frames)| frames.len() > 2)
    });
    interrupt(program);
    let (head, frames) = recording::read(File::open(bench.path("device.input")).unwrap()).unwrap();
    assert_eq!(head, unknown);
    assert_eq!(frames[0].1, [encode(AXIS, X, 32767), encode(0, 0, 0)].concat());
    fails(&controller.domain, &words, 1, &["exists"]);
    // Played into the questions: at rest, then the control of each answer.
    device.unplug();
    device.plug_in(&unknown);
    let mut learn = i2ris_testing::program::command(&[
        "teleop", "input", "learn", &played, "--output", &profile,
    ]);
    let learn = learn.stdin(std::process::Stdio::piped()).stdout(std::process::Stdio::piped());
    let mut learn = learn.spawn().unwrap();
    let mut answers = learn.stdin.take().unwrap();
    let mut questions = BufReader::new(learn.stdout.take().unwrap()).lines();
    for (question, events) in [
        ("release all controls", &[(AXIS, X, 0), (AXIS, Y, 0)][..]),
        ("to the right", &[(AXIS, X, 32767)]),
        ("away from you", &[(AXIS, X, 0), (AXIS, Y, -32768)]),
        ("shall be the dead-man", &[(AXIS, Y, 0), (KEY, BTN_TR, 1)]),
    ] {
        assert!(questions.next().unwrap().unwrap().contains(question));
        for (kind, code, value) in events {
            device.send(*kind, *code, *value);
        }
        answers.write_all(b"\n").unwrap();
    }
    assert!(learn.wait().unwrap().success());
    let text = bench.read("mine.toml");
    let learned = ["1234:abcd", "right = \"ABS_X\"", "up = \"-ABS_Y\"", "dead_man = \"BTN_TR\""];
    assert_says(&text, &learned);
    // The recording, played by the program: known now, but it steers nothing, being never at rest.
    device.unplug();
    let words = format!("teleop --device {played} --profile {profile}");
    let play = start(&controller.domain, &format!("teleop input play {file} --to {played}"));
    let teleop = start(&controller.domain, &words);
    controller.wait("commands", |robot| robot.poses.len() > 50);
    assert_near(assert_holds(&controller), [1.0, -1.0]);
    ends(play, 0, &[]);
    interrupt(teleop);
}

#[test]
fn keys_steer_after_space_and_silence_opens_the_clutch() {
    let controller = Controller::enabled();
    let words = ["teleop", "--keyboard", "--step-deg", "0.5"];
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
    assert_eq!((robot.lease, robot.requested.last()), (0, Some(&StateCommand::Release)));
    assert_no_jump(&robot.poses, 10.0);
}

#[test]
fn invalid_devices_and_two_masters_are_refused() {
    let controller = Controller::enabled();
    let device = Played::new(&pedal());
    let (pipe, folder) = (device.file(), device.bench.file(""));
    for (words, code, parts) in [
        ("--device /nonexistent/event7".to_owned(), 1, &["/nonexistent/event7: No such"][..]),
        (format!("--device {folder}"), 1, &["is a folder"]),
        (format!("--device {pipe}"), 1, &["a pedal alone moves nothing"]),
        ("--device /dev/null".to_owned(), 1, &["/dev/null: "]),
        ("--keyboard".to_owned(), 1, &["needs a terminal"]),
        ("--keyboard --device x".to_owned(), 2, &["cannot be used with"]),
        ("--view upside-down".to_owned(), 2, &["DEG,mirror"]),
        ("--profile /nonexistent.toml".to_owned(), 1, &["/nonexistent.toml: No such"]),
        ("--scale 1,7".to_owned(), 2, &["0.01 to 1"]),
    ] {
        fails(&controller.domain, &format!("teleop {words}"), code, parts);
    }
    assert!(controller.robot().poses.is_empty());
}
