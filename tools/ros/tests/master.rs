//! A CRTK arm as an input device: a program that acts as arm and pedal, and the programs it leads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::ipc::payload::ServoJp;
use i2ris::units::Nanos;
use i2ris_ros::message::{JointState, Joy, Point, Pose, PoseStamped};
use i2ris_testing::{Controller, Program, SetOnDrop, wait_until};
use ros2_client::qos::Durability;

use crate::common::{publisher, qos, ros_domain};

/// Hand of a surgeon.
#[derive(Debug, Clone, Copy)]
struct Hand {
    /// Position to the right and up, m.
    at: [f64; 2],
    pressed: bool,
    speaks: bool,
}

/// Streams the arm and its pedal, 200 times a second.
fn speak(domain: u16, hand: &Mutex<Hand>, ended: &AtomicBool) {
    let (_context, mut node) = i2ris_ros::join(domain, &[], "mtm").unwrap();
    let qos = qos(Durability::Volatile);
    let arm = publisher::<PoseStamped>(&mut node, "MTML", "measured_cp", &qos);
    let joints = publisher::<JointState>(&mut node, "MTML", "measured_js", &qos);
    let pedal = publisher::<Joy>(&mut node, "MTML", "/footpedals/coag", &qos);
    for number in 0.. {
        let Hand { at: [x, y], pressed, speaks } = *hand.lock().unwrap();
        if ended.load(Ordering::Relaxed) {
            return;
        }
        if speaks {
            // A hand trembles.
            let x = x + 2e-5 * f64::from(number % 2);
            let pose = Pose { position: Point { x, y, z: 0.3 }, ..Pose::default() };
            // Dropped if the other end does not keep up.
            let _ = arm.publish(PoseStamped { pose, ..PoseStamped::default() });
            let name = ["outer_pitch", "outer_yaw"].map(str::to_owned).into();
            let _ = joints.publish(JointState { name, position: vec![y, x], ..Default::default() });
            let _ = pedal.publish(Joy { buttons: vec![pressed.into()], ..Joy::default() });
        }
        clock::sleep(Nanos::from_millis(5));
    }
}

/// The arm, `i2ris start ros master` that follows it with these words, and `i2ris teleop`.
struct Leading {
    controller: Controller,
    hand: Mutex<Hand>,
    domain: u16,
    folder: tempfile::TempDir,
}

impl Leading {
    fn new() -> Self {
        let hand = Hand { at: [0.1, 0.05], pressed: false, speaks: true };
        Self {
            controller: Controller::enabled(),
            hand: Mutex::new(hand),
            domain: ros_domain(),
            folder: tempfile::tempdir().unwrap(),
        }
    }

    fn pipe(&self) -> String {
        self.folder.path().join("master.pipe").to_str().unwrap().to_owned()
    }

    /// Starts both programs, and waits until the master was seen at rest.
    fn start(&self, axes: &[&str]) -> [Program; 2] {
        let (pipe, number) = (self.pipe(), self.domain.to_string());
        let words = ["start", "ros", "master", "MTML", "--to", &pipe, "--ros-domain", &number];
        let master = Program::start(&self.controller.domain, &[&words[..], axes].concat());
        wait_until("the pipe", || std::path::Path::new(&pipe).exists());
        // It may be silent for longer than a loaded machine is.
        let profile = self.folder.path().join("arm.toml");
        let shipped = include_str!("../../../config/devices/crtk.toml");
        std::fs::write(&profile, shipped.replace("silence_ms = 50\n", "silence_ms = 5000\n"))
            .unwrap();
        let profile = profile.to_str().unwrap();
        let words = ["teleop", "--mode", "position", "--reach-deg", "2", "--device", &pipe];
        let words = [&words[..], &["--profile", profile]].concat();
        let teleop = Program::start(&self.controller.domain, &words);
        self.controller.wait("commands", |robot| robot.poses.len() > 100);
        assert_eq!(self.holds(), [1.0, -1.0]);
        [master, teleop]
    }

    fn set(&self, change: impl Fn(&mut Hand)) {
        change(&mut self.hand.lock().unwrap());
    }

    fn press(&self, pressed: bool) {
        self.set(|hand| hand.pressed = pressed);
    }

    fn is_open(&self) -> bool {
        self.controller.robot().flags & ServoJp::CLUTCH != 0
    }

    /// Expects that the snake holds, and stays where it is.
    fn holds(&self) -> [f64; 2] {
        wait_until("the clutch opens", || self.is_open());
        let there = self.controller.robot().pose;
        let before = self.controller.robot().poses.len();
        // Two commands are far enough apart for the master to be seen at rest.
        self.controller.wait("commands", |robot| robot.poses.len() > before + 50);
        assert_eq!(self.controller.robot().pose, there);
        there
    }

    /// Closes the clutch and moves the full travel up.
    fn goes_up(&self) {
        self.press(true);
        wait_until("a closed clutch", || !self.is_open());
        // The whole way up is 5 cm: 2 deg without dead zone.
        self.set(|hand| hand.at = [0.1, 0.1]);
        self.controller.wait("the whole way", |robot| robot.pose[0] > 2.99);
        let yaw_deg = self.controller.robot().pose[1];
        assert!((yaw_deg + 1.0).abs() < 1e-9, "the other axis stood still");
    }
}

/// Runs an arm, the two programs, and a story.
fn lead(axes: &[&str], story: impl FnOnce(&Leading, [Program; 2])) -> Leading {
    let (leading, ended) = (Leading::new(), AtomicBool::new(false));
    thread::scope(|scope| {
        let _end = SetOnDrop(&ended);
        scope.spawn(|| speak(leading.domain, &leading.hand, &ended));
        let programs = leading.start(axes);
        leading.goes_up();
        story(&leading, programs);
    });
    leading
}

#[test]
fn arm_steers_with_its_pedal_and_silence_opens_the_clutch() {
    let leading = lead(&[], |leading, [mut master, mut teleop]| {
        // Silent, with the pedal down, and moving.
        leading.set(|hand| hand.speaks = false);
        let there = leading.holds();
        leading.set(|hand| (hand.speaks, hand.at) = (true, [0.12, 0.02]));
        assert_eq!(leading.holds(), there, "the pedal was down all the time");
        leading.press(false);
        leading.holds();
        wait_until("it is taken again", || {
            leading.press(false);
            clock::sleep(Nanos::from_millis(500));
            leading.press(true);
            clock::sleep(Nanos::from_millis(300));
            !leading.is_open()
        });
        leading.press(false);
        leading.holds();
        teleop.interrupt();
        let (code, printed, error) = teleop.code();
        assert_eq!(code, Some(0), "{printed}{error}");
        assert!(printed.contains("CRTK MTML") && printed.contains("is gone"), "{printed}");
        master.interrupt();
        let (success, printed, error) = master.end();
        assert!(success && printed.contains("/MTML is silent"), "{printed}{error}");
    });
    assert!(!std::path::Path::new(&leading.pipe()).exists());
}

#[test]
fn the_joints_of_another_arm_steer_where_they_are_named() {
    let axes = ["--axes", "outer_yaw,outer_pitch"];
    lead(&axes, |leading, _programs| {
        leading.press(false);
        leading.holds();
    });
}
