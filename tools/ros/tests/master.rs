//! Another arm as an input device: a program that speaks CRTK, its pedal, `i2ris ros master` and
//! `i2ris teleop` before a controller.

use std::sync::Mutex;
use std::thread;

use i2ris::clock;
use i2ris::ipc::payload::ServoJp;
use i2ris::units::Nanos;
use i2ris_ros::message::{Joy, Point, Pose, PoseStamped};
use i2ris_testing::{Controller, Program, wait_until};
use ros2_client::qos::Durability;

use crate::peer::{publisher, qos, ros_domain};

/// What a surgeon does.
#[derive(Debug, Clone, Copy)]
struct Hand {
    /// To the right and up, m.
    at: [f64; 2],
    pressed: bool,
    speaks: bool,
    ended: bool,
}

/// Streams the arm and its pedal, 200 times a second.
fn speak(domain: u16, hand: &Mutex<Hand>) {
    let (_context, mut node) = i2ris_ros::join(domain, &[], "mtm").unwrap();
    let qos = qos(Durability::Volatile);
    let place = ("geometry_msgs", "PoseStamped");
    let arm = publisher::<PoseStamped>(&mut node, "MTML", "measured_cp", place, &qos);
    let foot = ("sensor_msgs", "Joy");
    let pedal = publisher::<Joy>(&mut node, "MTML", "/footpedals/coag", foot, &qos);
    for number in 0.. {
        let Hand { at: [x, y], pressed, speaks, ended } = *hand.lock().unwrap();
        if ended {
            return;
        }
        if speaks {
            // A hand trembles.
            let x = x + 2e-5 * f64::from(number % 2);
            let pose = Pose { position: Point { x, y, z: 0.3 }, ..Pose::default() };
            // Dropped where the other end does not keep up.
            let _ = arm.publish(PoseStamped { pose, ..PoseStamped::default() });
            let _ = pedal.publish(Joy { buttons: vec![pressed.into()], ..Joy::default() });
        }
        clock::sleep(Nanos::from_millis(5));
    }
}

struct Ended<'a>(&'a Mutex<Hand>);

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        self.0.lock().unwrap().ended = true;
    }
}

#[test]
fn another_arm_steers_under_its_pedal_and_its_silence_opens_the_clutch() {
    let (controller, domain) = (Controller::enabled(), ros_domain());
    let folder = std::env::temp_dir().join(format!("i2ris-master-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let pipe = folder.join("master.pipe");
    let pipe = pipe.to_str().unwrap();
    let hand = Mutex::new(Hand { at: [0.1, 0.05], pressed: false, speaks: true, ended: false });
    let set = |change: &dyn Fn(&mut Hand)| change(&mut hand.lock().unwrap());
    let is_open = || controller.robot().flags & ServoJp::CLUTCH != 0;
    // What lies between two commands is long enough for the master to be seen at rest.
    let some_commands = |count: usize| {
        let before = controller.robot().poses.len();
        controller.wait("commands", |robot| robot.poses.len() > before + count);
    };
    let holds = || {
        controller.wait("the clutch opens", |robot| robot.flags & ServoJp::CLUTCH != 0);
        let there = controller.robot().pose;
        some_commands(50);
        assert_eq!(controller.robot().pose, there);
        there
    };
    thread::scope(|scope| {
        let _ended = Ended(&hand);
        scope.spawn(|| speak(domain, &hand));
        let number = domain.to_string();
        let words = ["ros", "master", "MTML", "--to", pipe, "--ros-domain", &number];
        let mut master = Program::start(&controller.domain, &words);
        wait_until("the pipe", || std::path::Path::new(pipe).exists());
        let words = ["teleop", "--mode", "position", "--reach-deg", "2", "--played", pipe];
        let mut teleop = Program::start(&controller.domain, &words);
        controller.wait("commands", |robot| robot.poses.len() > 100);
        assert_eq!(holds(), [1.0, -1.0]);
        let press = |pressed: bool| set(&|hand| hand.pressed = pressed);
        press(true);
        controller.wait("a closed clutch", |robot| robot.flags & ServoJp::CLUTCH == 0);
        // The whole way up is 5 cm: 2 deg without dead zone.
        set(&|hand| hand.at = [0.1, 0.1]);
        controller.wait("the whole way", |robot| robot.pose[0] > 2.99);
        assert!((controller.robot().pose[1] + 1.0).abs() < 1e-9, "the other axis stood still");
        // Silent, with the pedal down, and moved meanwhile.
        set(&|hand| hand.speaks = false);
        let there = holds();
        set(&|hand| (hand.speaks, hand.at) = (true, [0.12, 0.02]));
        assert_eq!(holds(), there, "the pedal was down all the time");
        press(false);
        holds();
        wait_until("it is taken again", || {
            press(false);
            clock::sleep(Nanos::from_millis(500));
            press(true);
            clock::sleep(Nanos::from_millis(300));
            !is_open()
        });
        press(false);
        holds();
        teleop.interrupt();
        let (code, said, error) = teleop.code();
        assert_eq!(code, Some(0), "{said}{error}");
        assert!(said.contains("CRTK MTML") && said.contains("is gone"), "{said}");
        master.interrupt();
        let (success, said, error) = master.end();
        assert!(success && said.contains("/MTML is silent"), "{said}{error}");
    });
    assert!(!std::path::Path::new(pipe).exists());
    std::fs::remove_dir_all(folder).unwrap();
}
