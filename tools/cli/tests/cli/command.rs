//! `i2ris command` against a controller without drives, and `i2ris command motor` on emulated ones.

use std::sync::atomic::Ordering;

use i2ris::ipc::{Fault, MaskedClientId, OperatingState, Refusal, StateCommand};
use i2ris::robot::{Cause, Reason};
use i2ris::{clock, units::Nanos};
use i2ris_testing::bench::{WorkFolder, assert_says, end, ends, expect_stalls};
use i2ris_testing::bench::{fails, interrupt, start, succeeds};
use i2ris_testing::{Controller, Rig, Terminal, unique_domain, wait_until};

/// Checks that each accepted pose is within `speed_deg_s` of the previous one, by their stamps.
/// Late poses are missing, so the steps themselves prove nothing. The program plays at most 20 ms
/// at a time, and its stamps jitter; a jump to a far pose is much more than that.
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
fn pose_is_reached_without_a_jump_and_lease_released() {
    let controller = Controller::start();
    let pose = "command pose -4 3.5 --home --speed-deg-s 30";
    let output = succeeds(&controller.domain, pose);
    let robot = controller.robot();
    let (enable, home) = (StateCommand::Enable, StateCommand::Home);
    assert_eq!(robot.requested, [enable, home, enable, StateCommand::Release]);
    assert_near(robot.pose, [-4.0, 3.5]);
    assert_no_jump(&robot.poses, 30.0);
    assert_eq!(robot.lease, 0);
    assert_says(&output, &["approaching", "followed within 0.0"]);
}

#[test]
fn pose_that_is_not_reached_is_a_failure() {
    let controller = Controller::enabled();
    controller.robot().short_deg = 1.01;
    let pose = "command pose -4 3.5 --duration-s 0.2 --speed-deg-s 30";
    fails(&controller.domain, pose, 1, &["1.01 deg from the end of the trajectory"]);
}

#[test]
fn a_circle_is_round_and_ends_by_itself() {
    let controller = Controller::enabled();
    let circle = "command circle --radius-deg 2 --centre-deg -1 0.5 --period-s 1 --duration-s 1";
    succeeds(&controller.domain, circle);
    let robot = controller.robot();
    assert_no_jump(&robot.poses, 13.0);
    let on_the_circle = |pose: &[f64; 2]| ((pose[0] + 1.0).hypot(pose[1] - 0.5) - 2.0).abs() < 1e-6;
    let round = robot.poses.iter().filter(|(_, pose)| on_the_circle(pose)).count();
    assert!(round > 10, "{round} of {}", robot.poses.len());
    assert!(robot.poses.iter().any(|(_, pose)| pose[0] < -2.5));
}

#[test]
fn file_is_followed_to_its_end_and_invalid_file_refused() {
    let controller = Controller::enabled();
    let bench = WorkFolder::with("wrong.csv", "t_s,pitch_deg\n0,0\n");
    let wrong = bench.file("wrong.csv");
    fails(&controller.domain, &format!("command file {wrong}"), 1, &[&wrong, "`yaw_deg`"]);
    assert!(controller.robot().poses.is_empty());
    bench.write("path.csv", "t_s,pitch_deg,yaw_deg\n0,0,0\n0.4,2,1\n0.8,-1,1\n");
    succeeds(&controller.domain, &format!("command file {}", bench.file("path.csv")));
    let robot = controller.robot();
    assert_near(robot.pose, [-1.0, 1.0]);
    assert_no_jump(&robot.poses, 10.0);
    assert!(robot.poses.iter().any(|(_, pose)| pose[0] > 1.7));
}

#[test]
fn ctrl_c_stops_softly_and_gives_the_lease_back() {
    let controller = Controller::enabled();
    let program = start(&controller.domain, "command sine --amplitude-deg 6 0 --period-s 2");
    controller.wait("the sine is under way", |robot| robot.pose[0] > 3.0);
    interrupt(program);
    let robot = controller.robot();
    assert_eq!((robot.requested.as_slice(), robot.lease), ([StateCommand::Release].as_slice(), 0));
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
    succeeds(&controller.domain, "command pose --duration-s 0.3");
    let robot = controller.robot();
    assert!(robot.poses.len() > 5);
    robot.poses.iter().for_each(|(_, pose)| assert_near(*pose, [1.0, -1.0]));
}

#[test]
fn robot_that_cannot_follow_is_not_moved_and_reason_reported() {
    let one_sentence = fails(&unique_domain(), "command pose", 3, &["no controller serves domain"]);
    assert_eq!(one_sentence.error.lines().count(), 1);
    let controller = Controller::start();
    fails(&controller.domain, "command pose", 4, &["DISABLED", "--enable"]);
    assert_eq!(controller.robot().requested, []);

    let controller = Controller::enabled();
    controller.robot().lease = 0xabc;
    let holder = &format!("{} holds the lease", MaskedClientId(0xabc));
    fails(&controller.domain, "command pose", 4, &[holder]);

    let controller = Controller::enabled();
    controller.robot().model = false;
    fails(&controller.domain, "command pose 0 0", 1, &["no model loaded"]);
}

#[test]
fn what_happens_on_the_way_ends_it_with_the_cause() {
    let on_the_way = |change: fn(&Controller), code, parts: &[&str]| {
        let controller = Controller::enabled();
        let program = start(&controller.domain, "command pose");
        controller.wait("commands arrive", |robot| robot.poses.len() > 10);
        change(&controller);
        ends(program, code, parts)
    };
    let fault = |controller: &Controller| {
        controller.robot().fault = Fault::FollowingError;
        controller.robot().state = OperatingState::Fault;
    };
    on_the_way(fault, 5, &["FAULT: fault 3: following error too large"]);
    let lost = &format!("lost the lease to {}", MaskedClientId(0xabc));
    on_the_way(|controller| controller.robot().lease = 0xabc, 4, &[lost]);
    let disable = |controller: &Controller| controller.robot().state = OperatingState::Disabled;
    let result = on_the_way(disable, 4, &["paused or disabled it"]);
    assert!(!result.error.contains("--enable"), "{}", result.error);
}

#[test]
fn refusals_are_reported_and_end_it_when_nothing_gets_through() {
    let controller = Controller::enabled();
    controller.robot().refuse = Some(Refusal::StepTooLarge);
    let sentence = "refuses every command: refusal 3: step too large";
    let result = fails(&controller.domain, "command pose", 4, &[sentence]);
    assert_says(&result.output, &["refused: step too large"]);
}

#[test]
fn a_controller_that_ends_ends_it() {
    let controller = Controller::enabled();
    let program = start(&controller.domain, "command pose");
    controller.wait("commands arrive", |robot| robot.poses.len() > 10);
    drop(controller);
    ends(program, 3, &["no controller serves domain"]);
}

#[test]
fn states_are_changed_or_the_refusal_is_reported() {
    let controller = Controller::start();
    let sentence = "refuses `enable` in state DISABLED: refusal 6: not homed";
    fails(&controller.domain, "enable", 4, &[sentence]);
    let printed = succeeds(&controller.domain, "home --json");
    let printed: serde_json::Value = serde_json::from_str(&printed).unwrap();
    assert_eq!((&printed["accepted"], &printed["state"]), (&"home".into(), &"DISABLED".into()));
    assert_says(&succeeds(&controller.domain, "enable"), &["the controller is ENABLED"]);
}

#[test]
fn disable_in_fault_reports_the_remaining_fault() {
    let controller = Controller::enabled();
    controller.robot().state = OperatingState::Fault;
    let output = succeeds(&controller.domain, "disable");
    assert_says(&output, &["is FAULT until `i2ris command state acknowledge`"]);
}

#[test]
fn pose_out_of_reach_is_reported_at_once_and_fails() {
    let controller = Controller::enabled();
    controller.robot().reach = 20.0;
    let pose = "command pose 63 -1 --speed-deg-s 60 --duration-s 0.2";
    let output = fails(&controller.domain, pose, 7, &["out of reach", "43.0 deg"]).output;
    let clipped = output.find("out of reach").expect(&output);
    assert!(clipped < output.find("followed within").unwrap(), "{output}");
    assert!(output.contains("43.0") && !output.contains("followed within 0.0"), "{output}");
    assert_eq!(controller.robot().lease, 0);
}

#[test]
fn homing_needs_its_own_consent() {
    let controller = Controller::start();
    let hold = "command pose --duration-s 0.1";
    let remedy = ["straighten the snake", "--home"];
    fails(&controller.domain, &format!("{hold} --enable"), 4, &remedy);
    assert!(!controller.robot().homed);
    let home = start(&controller.domain, &format!("{hold} --home"));
    ends(home, 0, &["the present pose becomes the zero"]);
}

#[test]
fn state_command_waits_for_completion_unless_no_wait() {
    let controller = Controller::enabled();
    controller.robot().busy_for = Nanos::from_millis(1000);
    let condition = "command state condition";
    assert_says(&succeeds(&controller.domain, condition), &["done: condition"]);
    assert!(!controller.robot().is_busy());
    controller.robot().busy_for = Nanos::from_millis(3_600_000);
    let output = succeeds(&controller.domain, &format!("{condition} --no-wait"));
    assert_says(&output, &["accepted: condition"]);
    assert!(controller.robot().is_busy());
    let waiting = start(&controller.domain, "command pose --duration-s 0.1");
    clock::sleep(Nanos::from_millis(300));
    assert!(controller.robot().poses.is_empty(), "it waits");
    controller.robot().end_activity();
    ends(waiting, 0, &[]);
    assert!(!controller.robot().poses.is_empty());
}

#[test]
fn stop_by_late_commands_is_reported_and_may_end_path() {
    let bench = WorkFolder::with("path.csv", "t_s,pitch_deg,yaw_deg\n0,1,-1\n1.5,2,1\n");
    let path = format!("command file {}", bench.file("path.csv"));
    for (more, expected) in [("", 0), ("--on-late end", 1)] {
        let controller = Controller::enabled();
        let program = start(&controller.domain, &format!("{path} {more}"));
        controller.wait("commands", |robot| robot.poses.len() > 5);
        controller.robot().stale_stops += 1;
        let result = end(program);
        assert_eq!(result.code, Some(expected), "{}", result.error);
        let notice = "commands came late; the trajectory is";
        assert_says(&format!("{}{}", result.output, result.error), &[notice]);
        controller.wait("the release", |robot| robot.lease == 0);
    }
}

#[test]
fn why_names_state_and_last_refusal_with_what_to_do() {
    let controller = Controller::start();
    let refusal = Reason::from(Cause::Refusal(Refusal::Range));
    controller.robot().reasons.push((refusal, 7));
    let output = succeeds(&controller.domain, "status");
    let state = ["state DISABLED", "refusal 6: not homed", "straighten the snake"];
    assert_says(&output, &[&state[..], &["refusal 9: outside the position limits"]].concat());
}

fn robot() -> Rig {
    let mut rig = Rig::start();
    expect_stalls(&mut rig);
    // 25 counts.
    rig.config.command.first_step_deg = 0.1 * rig.config.command.max_step_deg;
    rig.camera_is_shut.store(true, Ordering::Relaxed);
    rig.start_controller_thread();
    rig.client();
    rig
}

#[test]
fn motor_moves_a_few_counts_and_returns() {
    let rig = robot();
    let domain = rig.domain();
    let begin = clock::now();
    for (words, code, part) in [
        ("0 20", 1, "--enable"),
        ("0 20 --enable", 4, "not homed"),
        ("0 101 --home", 2, "1 to 100 counts"),
        ("2 20 --home", 1, "there are 2, from 0"),
    ] {
        fails(&domain, &format!("command motor {words}"), code, &[part]);
    }
    assert!(!rig.moved_since(begin), "nothing moves before it is permitted");
    let origin = rig.emulator.snapshot().axes.map(|axis| axis.drive.motor_counts);
    for (motor, counts, permission) in [(0, 20, "--home"), (1, -20, "--enable")] {
        let result = succeeds(&domain, &format!("command motor {motor} {counts} {permission}"));
        let first = |line: &str| line.split_whitespace().next()?.parse().ok();
        let targets: Vec<i32> = result.lines().filter_map(first).collect();
        // The exit code shows that each target was reached.
        assert_eq!(targets, [counts / 2, counts, counts / 2, 0], "{result}");
        let now = rig.emulator.snapshot().axes.map(|axis| axis.drive.motor_counts);
        let off = [0, 1].map(|axis| (now[axis] - origin[axis]).abs());
        assert!(off.iter().all(|off| *off <= 3.0), "both are where they began: {off:?}");
        let written = rig.setpoints(motor).into_iter().map(|(_, to)| to);
        let (low, high) = (counts.min(0), counts.max(0));
        let written: Vec<i32> = written.filter(|to| *to < low - 2 || *to > high + 2).collect();
        assert!(written.is_empty(), "not beyond the target: {written:?}");
    }
}

#[test]
fn a_person_types_yes_and_ctrl_c_holds() {
    let rig = robot();
    let domain = rig.domain();
    for (typed, end) in [("no\n", "nothing has moved"), ("yes\n", "    0 ")] {
        let mut terminal = Terminal::start(&domain, &["command", "motor", "0", "-20"], 30, 100);
        terminal.wait_for("Type yes.");
        let is_still = rig.setpoints(0).windows(2).all(|pair| pair[0].1 == pair[1].1);
        assert!(is_still, "no motion before permission");
        terminal.type_keys(typed);
        terminal.wait_for(end);
        assert_eq!(terminal.end().success(), typed == "yes\n");
    }
    let mut program = start(&domain, "command motor 0 100 --enable");
    wait_until("it is under way", || rig.positions()[0] > 20);
    program.interrupt();
    ends(program, 1, &["interrupted", "holds"]);
    rig.wait_until_still();
    assert!(rig.positions()[0] < 95, "it stopped on its way");
    assert!(rig.emulator.snapshot().axes[0].drive.state.is_powered());
}
