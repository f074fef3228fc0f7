//! `i2ris command` against a controller without drives.

use std::io::Write;

use i2ris::clock;
use i2ris::ipc::{Domain, Fault, OperatingState, Refusal, StateCommand, random_id};
use i2ris::robot::{Cause, Reason};
use i2ris::units::Nanos;
use i2ris_testing::{Controller, Program};

/// Checks every accepted pose against the one before: no further than `speed_deg_s` allows in the
/// time between their stamps. What the controller did not read in time is missing, so the steps
/// themselves say nothing. The program plays at most 20 ms in one go, and its stamps jitter; a jump
/// to a far pose is much more than that.
pub fn assert_no_jump(poses: &[(Nanos, [f64; 2])], speed_deg_s: f64) {
    let mut before: Option<(Nanos, [f64; 2])> = None;
    for &(stamp, pose) in poses {
        let (then, from) = before.replace((stamp, pose)).unwrap_or((stamp, [1.0, -1.0]));
        let step = (pose[0] - from[0]).hypot(pose[1] - from[1]);
        let allowed = speed_deg_s * ((stamp - then).as_seconds() + 0.02) + 1e-6;
        assert!(step <= allowed, "{step} deg from {from:?} to {pose:?}, allowed {allowed}");
    }
}

pub fn assert_near(pose: [f64; 2], target: [f64; 2]) {
    assert!((pose[0] - target[0]).hypot(pose[1] - target[1]) < 1e-6, "{pose:?}");
}

#[test]
fn without_a_controller_it_says_so() {
    let domain = Domain::new(&format!("t{:016x}", random_id())).unwrap();
    let (success, _, error) = Program::run(&domain, &["command", "hold"]);
    assert!(
        !success && error.contains("no controller serves domain") && error.contains(domain.name()),
        "{error}"
    );
    assert_eq!(error.lines().count(), 1, "{error}");
}

#[test]
fn a_pose_is_reached_without_a_jump_and_the_lease_given_back() {
    let controller = Controller::start();
    let arguments =
        ["command", "pose", "-4", "3.5", "--home", "--duration-s", "0.2", "--speed-deg-s", "30"];
    let (success, output, error) = Program::run(&controller.domain, &arguments);
    assert!(success, "{error}");
    let robot = controller.robot();
    assert_eq!(
        robot.asked,
        [StateCommand::Enable, StateCommand::Home, StateCommand::Enable, StateCommand::Release]
    );
    assert_near(robot.pose, [-4.0, 3.5]);
    assert_no_jump(&robot.poses, 30.0);
    assert_eq!(robot.lease, 0);
    assert!(output.contains("approaching") && output.contains("followed within 0.0"), "{output}");
}

#[test]
fn a_circle_is_round_and_ends_by_itself() {
    let controller = Controller::enabled();
    let arguments = [
        "command",
        "circle",
        "--radius-deg",
        "2",
        "--center",
        "-1",
        "0.5",
        "--period-s",
        "1",
        "--duration-s",
        "1",
    ];
    let (success, _, error) = Program::run(&controller.domain, &arguments);
    assert!(success, "{error}");
    let robot = controller.robot();
    assert_no_jump(&robot.poses, 13.0);
    let on_the_circle = |pose: &[f64; 2]| ((pose[0] + 1.0).hypot(pose[1] - 0.5) - 2.0).abs() < 1e-6;
    let round = robot.poses.iter().filter(|(_, pose)| on_the_circle(pose)).count();
    assert!(round > 10, "{round} of {}", robot.poses.len());
    assert!(robot.poses.iter().any(|(_, pose)| pose[0] < -2.5));
}

#[test]
fn a_file_is_followed_to_its_last_row() {
    let controller = Controller::enabled();
    let mut file = tempfile::NamedTempFile::new().unwrap();
    write!(file, "t_s,pitch_deg,yaw_deg\n0,0,0\n0.4,2,1\n0.8,-1,1\n").unwrap();
    let (success, _, error) =
        Program::run(&controller.domain, &["command", "file", file.path().to_str().unwrap()]);
    assert!(success, "{error}");
    let robot = controller.robot();
    assert_near(robot.pose, [-1.0, 1.0]);
    assert_no_jump(&robot.poses, 10.0);
    assert!(robot.poses.iter().any(|(_, pose)| pose[0] > 1.7));
}

#[test]
fn a_wrong_file_moves_nothing() {
    let controller = Controller::enabled();
    let mut file = tempfile::NamedTempFile::new().unwrap();
    write!(file, "t_s,pitch_deg\n0,0\n").unwrap();
    let path = file.path().to_str().unwrap().to_owned();
    let (success, _, error) = Program::run(&controller.domain, &["command", "file", &path]);
    assert!(!success && error.contains(&path) && error.contains("`yaw_deg`"), "{error}");
    assert!(controller.robot().poses.is_empty());
}

#[test]
fn ctrl_c_stops_softly_and_gives_the_lease_back() {
    let controller = Controller::enabled();
    let arguments = ["command", "sine", "--amplitude-deg", "6", "0", "--period-s", "2"];
    let mut program = Program::start(&controller.domain, &arguments);
    controller.wait("the sine is under way", |robot| robot.pose[0] > 3.0);
    program.interrupt();
    let (success, _, error) = program.end();
    assert!(success, "{error}");
    let robot = controller.robot();
    assert_eq!((robot.asked.as_slice(), robot.lease), ([StateCommand::Release].as_slice(), 0));
    // It came to rest: at the end it was much slower than before.
    let speed = |pair: &[(Nanos, [f64; 2])]| {
        (pair[1].1[0] - pair[0].1[0]).abs() / (pair[1].0 - pair[0].0).as_seconds()
    };
    let speeds: Vec<f64> = robot.poses.windows(2).map(speed).collect();
    let (fastest, last) = (speeds.iter().copied().fold(0.0, f64::max), *speeds.last().unwrap());
    assert!(last < 0.3 * fastest, "{last} of {fastest}");
}

#[test]
fn a_held_pose_stays_where_it_is() {
    let controller = Controller::enabled();
    let (success, _, error) =
        Program::run(&controller.domain, &["command", "hold", "--duration-s", "0.3"]);
    assert!(success, "{error}");
    let robot = controller.robot();
    assert!(robot.poses.len() > 5);
    robot.poses.iter().for_each(|(_, pose)| assert_near(*pose, [1.0, -1.0]));
}

#[test]
fn a_robot_that_is_not_enabled_is_left_alone() {
    let controller = Controller::start();
    let (success, _, error) = Program::run(&controller.domain, &["command", "hold"]);
    assert!(!success && error.contains("DISABLED") && error.contains("--enable"), "{error}");
    assert_eq!(controller.robot().asked, []);
}

#[test]
fn without_a_model_angles_make_no_sense() {
    let controller = Controller::enabled();
    controller.robot().model = false;
    let (success, _, error) = Program::run(&controller.domain, &["command", "pose", "0", "0"]);
    assert!(!success && error.contains("no model loaded"), "{error}");
}

#[test]
fn a_fault_on_the_way_ends_it_with_the_cause() {
    let controller = Controller::enabled();
    let program = Program::start(&controller.domain, &["command", "hold"]);
    controller.wait("commands arrive", |robot| robot.poses.len() > 10);
    controller.robot().fault = Fault::FollowingError;
    controller.robot().state = OperatingState::Fault;
    let (success, _, error) = program.end();
    assert!(
        !success && error.contains("FAULT: fault 3: set-point and encoder are too far apart"),
        "{error}"
    );
}

#[test]
fn a_lost_lease_ends_it() {
    let controller = Controller::enabled();
    let program = Program::start(&controller.domain, &["command", "hold"]);
    controller.wait("commands arrive", |robot| robot.poses.len() > 10);
    controller.robot().lease = 0xabc;
    let (success, _, error) = program.end();
    assert!(!success && error.contains("lost the lease to client 0000000000000abc"), "{error}");
}

#[test]
fn a_lease_in_other_hands_is_respected() {
    let controller = Controller::enabled();
    controller.robot().lease = 0xabc;
    let (success, _, error) = Program::run(&controller.domain, &["command", "hold"]);
    assert!(!success && error.contains("client 0000000000000abc holds the lease"), "{error}");
}

#[test]
fn refusals_are_told_and_end_it_when_nothing_gets_through() {
    let controller = Controller::enabled();
    controller.robot().refuse = Some(Refusal::Step);
    let (success, output, error) = Program::run(&controller.domain, &["command", "hold"]);
    assert!(
        !success && error.contains("refuses every command: refusal 3: step too large"),
        "{error}"
    );
    assert!(output.contains("refused: step too large"), "{output}");
}

#[test]
fn a_controller_that_ends_ends_it() {
    let controller = Controller::enabled();
    let program = Program::start(&controller.domain, &["command", "hold"]);
    controller.wait("commands arrive", |robot| robot.poses.len() > 10);
    drop(controller);
    let (success, _, error) = program.end();
    assert!(!success && error.contains("no controller serves domain"), "{error}");
}

#[test]
fn states_are_changed_or_the_refusal_is_told() {
    let controller = Controller::start();
    let (success, _, error) = Program::run(&controller.domain, &["command", "state", "enable"]);
    assert!(
        !success && error.contains("refuses `enable` in state DISABLED: refusal 6: not homed"),
        "{error}"
    );
    assert!(Program::run(&controller.domain, &["command", "state", "home"]).0);
    let (success, output, _) = Program::run(&controller.domain, &["command", "state", "enable"]);
    assert!(success && output.contains("the controller is ENABLED"), "{output}");
}

#[test]
fn a_pose_out_of_reach_is_reported_at_once_and_is_no_success() {
    let controller = Controller::enabled();
    controller.robot().reach = 20.0;
    let pose = ["command", "pose", "63", "-1", "--speed-deg-s", "60"];
    let program =
        Program::start(&controller.domain, &[&pose[..], &["--duration-s", "0.2"]].concat());
    let (code, output, error) = program.code();
    assert_eq!(code, Some(7), "{output}{error}");
    assert!(error.contains("out of reach") && error.contains("43.0 deg"), "{error}");
    let clipped = output.find("out of reach").expect(&output);
    assert!(clipped < output.find("followed within").unwrap(), "{output}");
    assert!(output.contains("43.0") && !output.contains("followed within 0.0"), "{output}");
    assert_eq!(controller.robot().lease, 0);
}

#[test]
fn homing_needs_its_own_consent() {
    let controller = Controller::start();
    let arguments = ["command", "hold", "--duration-s", "0.1"];
    let enable = Program::start(&controller.domain, &[&arguments[..], &["--enable"]].concat());
    let (code, _, error) = enable.code();
    assert_eq!(code, Some(4), "{error}");
    assert!(error.contains("straighten the snake") && error.contains("--home"), "{error}");
    assert!(!controller.robot().homed);
    let home = Program::start(&controller.domain, &[&arguments[..], &["--home"]].concat());
    let (code, _, error) = home.code();
    assert_eq!(code, Some(0), "{error}");
    assert!(error.contains("the present pose becomes the zero"), "{error}");
}

#[test]
fn a_state_command_ends_when_it_is_carried_out_and_no_wait_before() {
    let controller = Controller::enabled();
    controller.robot().busy_for = Nanos::from_millis(1000);
    let (success, output, error) =
        Program::run(&controller.domain, &["command", "state", "condition"]);
    assert!(success && output.contains("done: condition"), "{output}{error}");
    assert!(!controller.robot().is_busy());
    controller.robot().busy_for = Nanos::from_millis(3_600_000);
    let arguments = ["command", "state", "condition", "--no-wait"];
    let (success, output, error) = Program::run(&controller.domain, &arguments);
    assert!(success && output.contains("accepted: condition"), "{output}{error}");
    assert!(controller.robot().is_busy());
    let waiting = Program::start(&controller.domain, &["command", "hold", "--duration-s", "0.1"]);
    clock::sleep(Nanos::from_millis(300));
    assert!(controller.robot().poses.is_empty(), "it waits");
    controller.robot().end_activity();
    let (code, _, error) = waiting.code();
    assert_eq!(code, Some(0), "{error}");
    assert!(!controller.robot().poses.is_empty());
}

#[test]
fn a_stop_by_late_commands_is_told_and_can_end_the_path() {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    write!(file, "t_s,pitch_deg,yaw_deg\n0,1,-1\n1.5,2,1\n").unwrap();
    let path = ["command", "file", file.path().to_str().unwrap()];
    for (more, expected) in [(&[][..], 0), (&["--on-late", "end"][..], 1)] {
        let controller = Controller::enabled();
        let program = Program::start(&controller.domain, &[&path[..], more].concat());
        controller.wait("commands", |robot| robot.poses.len() > 5);
        controller.robot().stale_stops += 1;
        let (code, output, error) = program.code();
        assert_eq!(code, Some(expected), "{output}{error}");
        let notice = "commands came late; the trajectory is";
        assert!(format!("{output}{error}").contains(notice), "{output}{error}");
        controller.wait("the release", |robot| robot.lease == 0);
    }
}

#[test]
fn a_controller_that_is_ended_or_disabled_meanwhile_is_named_as_such() {
    let controller = Controller::enabled();
    let program = Program::start(&controller.domain, &["command", "hold"]);
    controller.wait("commands", |robot| robot.poses.len() > 5);
    controller.robot().state = OperatingState::Disabled;
    let (code, _, error) = program.code();
    assert_eq!(code, Some(4), "{error}");
    assert!(error.contains("disabled or ended") && !error.contains("--enable"), "{error}");
}

#[test]
fn a_wrong_domain_is_a_wrong_command_line() {
    let output = i2ris_testing::program::output(&["command", "--domain", "a/b", "hold"]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn why_names_state_and_last_refusal_with_what_to_do() {
    let controller = Controller::start();
    let refusal = Reason::from(Cause::Refusal(Refusal::Range));
    controller.robot().reasons.push((refusal, 7));
    let (success, output, error) = Program::run(&controller.domain, &["why"]);
    assert!(success, "{error}");
    for part in [
        "state DISABLED",
        "refusal 6: not homed",
        "straighten the snake",
        "refusal 9: outside the position limits",
    ] {
        assert!(output.contains(part), "{part}: {output}");
    }
}
