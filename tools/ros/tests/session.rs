//! A client of ROS, with the topics and the quality of service of CRTK's, and the emulated snake.

use std::process::{Command, Stdio};

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::robot::StateCommand;
use i2ris::units::Nanos;
use i2ris_report::snake::Snake;
use i2ris_ros::message::{Header, JointState, OperatingState, Text, Time};
use i2ris_testing::program::full_pipe;
use i2ris_testing::{Killed, wait_until};
use ros2_client::QosProfile;
use ros2_client::qos::Durability;

use crate::common::{
    Bridge, Peer, ROBOT, enabled, publisher, qos, repeat, robot, ros_domain, start, start_with,
    subscription, wait_for,
};

fn stamp(state: &OperatingState) -> u64 {
    state.header.stamp.unix_ns().unwrap()
}

#[test]
fn a_client_homes_enables_moves_servoes_and_holds() {
    let (mut robot, bridge, mut peer) = enabled();
    // From rest to rest.
    peer.seen.clear();
    peer.send_degrees("move_jp", [4.0, -2.0]);
    peer.wait_for_motion();
    let [pitch, yaw] = peer.setpoint_degrees();
    assert!((pitch - 4.0).abs() < 0.2 && (yaw + 2.0).abs() < 0.2, "{pitch} {yaw}");
    // By a difference.
    peer.send_degrees("move_jr", [-4.0, 2.0]);
    peer.wait_for_motion();
    let [pitch, yaw] = peer.setpoint_degrees();
    assert!(pitch.abs() < 0.2 && yaw.abs() < 0.2, "{pitch} {yaw}");
    // A stream.
    let from = clock::now();
    peer.stream(|t| (t < 1.5).then(|| [3.0 * (2.0 * t).sin(), 0.0]));
    assert!(robot.moved_since(from), "{:?}", bridge.lines());
    peer.hold();
    robot.wait_until_still();
    wait_until("the snake follows the steps", || {
        // A stream that was stopped, by `hold` or by load, restarts after a silence and `hold`.
        clock::sleep(Nanos::from_millis(1100));
        peer.hold();
        clock::sleep(Nanos::from_millis(200));
        let [before, _] = peer.setpoint_degrees();
        repeat(50, 5, |_| peer.send_degrees("servo_jr", [0.02, 0.0]));
        clock::sleep(Nanos::from_millis(200));
        let [after, _] = peer.setpoint_degrees();
        after - before > 0.5
    });
    peer.wait_for_line("status", "console commands");
    let state = wait_for(&mut robot, |state| state.lease_client_id == 0);
    assert_eq!(state.fault, 0);
    assert!(bridge.end(), "it ends cleanly");
}

#[test]
fn zero_length_move_is_busy_then_idle_with_rising_stamps() {
    let (_robot, _bridge, mut peer) = enabled();
    let pose = peer.setpoint_degrees();
    for _ in 0..3 {
        let before = peer.seen.len();
        peer.send_degrees("move_jp", pose);
        wait_until("busy, then not busy", || {
            peer.update();
            let busy: Vec<bool> = peer.seen[before..].iter().map(|it| it.is_busy).collect();
            busy.ends_with(&[true, false])
        });
    }
    let stamps: Vec<u64> = peer.seen.iter().map(stamp).collect();
    assert!(stamps.windows(2).all(|pair| pair[0] < pair[1]), "{stamps:?}");
}

#[test]
fn a_late_subscriber_gets_the_state_and_earlier_reports() {
    let (_robot, _bridge, peer) = enabled();
    let mut late = Peer::new(peer.node.domain_id(), ROBOT, "late");
    late.wait_for("the latched state", |state| state.state == "ENABLED");
    late.wait_for_line("status", "the robot is ENABLED");
    assert!(late.seen.len() > 1, "also the earlier states");
    assert!(late.seen.windows(2).all(|pair| stamp(&pair[0]) < stamp(&pair[1])));
    let latched = qos(Durability::TransientLocal);
    let description = subscription::<Text>(&mut late.node, ROBOT, "robot_description", &latched);
    let urdf = wait_until("the URDF", || description.take().ok().flatten());
    assert_eq!(urdf.0.data, Snake::new(ROBOT).urdf());
}

#[test]
fn reports_from_before_the_start_are_not_repeated() {
    let (mut robot, domain) = (robot(), ros_domain());
    let refused = robot.client().state_command(StateCommand::Enable);
    assert!(refused.is_err(), "it is not homed");
    let mut seen = robot.client().watcher().warning();
    wait_until("the controller reports it", || seen.newest().ok().flatten());
    let bridge = Bridge::start(&robot.domain(), domain, &[]);
    let mut peer = Peer::new(domain, ROBOT, "console");
    peer.connect();
    let again = robot.client().state_command(StateCommand::Resume);
    assert!(again.is_err(), "it is not paused");
    peer.wait_for_line("warning", "the drives are off");
    bridge.wait_for("the drives are off");
    let lines = bridge.lines();
    let warnings = lines.iter().filter(|line| line.starts_with("warning"));
    assert_eq!(warnings.count(), 1, "{lines:?}");
}

#[test]
fn missing_controller_gives_undefined_state_and_stamp_zero() {
    let (mut robot, bridge, mut peer) = start();
    peer.wait_for("a controller", |state| state.state == "DISABLED");
    peer.next_measured(|it| it.header.stamp != Time::INVALID && it.position.len() == 2);
    robot.stop_controller_thread();
    peer.wait_for("no controller", |state| state.state == "UNDEFINED");
    peer.next_measured(|it| it.header.stamp == Time::INVALID && it.position.is_empty());
    peer.next_tip(|it| it.header.stamp == Time::INVALID);
    bridge.wait_for("no controller serves domain");
    robot.start_controller_thread();
    peer.wait_for("a controller again", |state| state.state == "DISABLED");
    peer.next_measured(|it| it.header.stamp != Time::INVALID);
}

#[test]
fn a_terminal_that_blocks_does_not_stop_the_bridge() {
    let (robot, domain) = (robot(), ros_domain());
    let (_reader, writer) = full_pipe();
    let mut bridge = Command::new(env!("CARGO_BIN_EXE_i2ris-ros"));
    bridge.args(["--command", "--home"]).env("I2RIS_DOMAIN", robot.domain().name());
    bridge.env("ROS_DOMAIN_ID", domain.to_string()).stdin(Stdio::null());
    let _bridge = Killed::start(bridge.stdout(writer));
    let mut peer = Peer::new(domain, ROBOT, "console");
    peer.enable();
    peer.hold();
    peer.wait_for_line("status", "/console: hold");
}

/// A forged datagram that requests gigabytes ends the bridge, and no other process.
#[test]
fn bridge_memory_is_limited_and_it_is_killed_first() {
    let (_robot, bridge, _peer) = start();
    let read = |name| std::fs::read_to_string(format!("/proc/{}/{name}", bridge.id())).unwrap();
    let limits = read("limits");
    let data = limits.lines().find(|line| line.starts_with("Max data size")).unwrap();
    assert_eq!(data.split_whitespace().nth(3), Some("2147483648"), "{data}");
    assert_eq!(read("oom_score_adj").trim(), "500");
}

#[test]
fn homing_needs_the_consent_of_who_started_the_bridge() {
    let (_robot, bridge, mut peer) = start_with(&["--command"]);
    peer.wait_for("a state", |_| true);
    assert!(bridge.lines()[0].contains("every user of this computer"), "{:?}", bridge.lines());
    peer.command("home");
    peer.wait_for_line("warning", "--home");
    assert!(!peer.seen.iter().any(|state| state.is_homed || state.is_busy));
}

#[test]
fn read_only_robot_has_no_topic_for_commands() {
    let (_robot, bridge, mut peer) = start_with(&[]);
    peer.wait_for("a state", |_| true);
    peer.wait_for_line("status", "the robot is DISABLED");
    assert!(bridge.lines()[0].contains("read-only"));
    peer.command("home");
    clock::sleep(Nanos::from_millis(1500));
    for topic in ["servo_jp", "move_jp", "state_command", "hold", "external/measured_jp"] {
        let name = format!("/{ROBOT}/{topic}");
        assert_eq!(peer.node.subscription_count(&name), 0, "{name}");
    }
    assert!(!peer.seen.iter().any(|state| state.is_homed || state.is_busy));
}

#[test]
fn no_commands_are_taken_where_a_network_takes_part() {
    let mut ros = Command::new(env!("CARGO_BIN_EXE_i2ris-ros"));
    let output = ros.args(["--command", "--network", "127.0.0.1"]).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    let words = ["'--command' cannot be used with", "--network"];
    assert!(!output.status.success() && words.iter().all(|word| stderr.contains(word)), "{stderr}");
}

#[test]
fn another_domain_and_another_name_are_another_robot() {
    let (robot, domain) = (robot(), ros_domain());
    let _bridge = Bridge::start(&robot.domain(), domain, &["--name", "eye"]);
    let mut there = Peer::new(domain, "eye", "there");
    there.connect();
    let (mut elsewhere, mut other) =
        (Peer::new(ros_domain(), "eye", "elsewhere"), Peer::new(domain, ROBOT, "other"));
    clock::sleep(Nanos::from_millis(3000));
    elsewhere.update();
    other.update();
    assert_eq!((elsewhere.seen.len(), other.seen.len()), (0, 0));
}

#[test]
fn a_camera_of_ros_feeds_the_controller() {
    let (mut robot, _bridge, mut peer) = start();
    peer.connect();
    let mut seen = robot.client().watcher().external();
    let found = wait_until("a measurement", || {
        let header = Header::new(i2ris::wall_clock::unix_time().0 - 30_000_000, "");
        let position = vec![0.02, -0.01];
        let message = JointState { header, position, ..JointState::default() };
        peer.send_message("external/measured_jp", message);
        clock::sleep(Nanos::from_millis(10));
        // The robot also has its own camera.
        let ours = |it: &ExternalPosition| it.position[..2] == [0.02, -0.01];
        seen.newest().ok().flatten().filter(ours).map(|seen| (seen, clock::now()))
    });
    let (measurement, now) = found;
    let age = now.duration_since(Nanos(measurement.stamp_ns));
    assert!(age >= Nanos::from_millis(30), "the exposure, not the arrival: {age:?}");
    peer.send("external/measured_jp", &[f64::NAN, 0.0]);
    peer.wait_for_line("warning", "external/measured_jp: a position is not finite");
}

#[test]
fn quality_of_service_that_does_not_fit_is_reported() {
    let (robot, _bridge, mut peer) = enabled();
    let best_effort = QosProfile::subscription_default();
    // Fits: a reader may request less than is offered.
    let less = subscription::<JointState>(&mut peer.node, ROBOT, "measured_js", &best_effort);
    wait_until("a best-effort reader is served", || less.take().ok().flatten());
    // Does not fit: a reader requests stored samples of a stream.
    let latched = qos(Durability::TransientLocal);
    let _more = subscription::<JointState>(&mut peer.node, ROBOT, "measured_js", &latched);
    peer.wait_for_line("warning", "wants RELIABLE TRANSIENT_LOCAL");
    // Does not fit: a writer offers less than commands need.
    let careless = publisher::<JointState>(&mut peer.node, ROBOT, "servo_jp", &best_effort);
    peer.wait_for_line("warning", "publishes BEST_EFFORT VOLATILE");
    let from = clock::now();
    repeat(100, 5, |step| {
        let position = vec![0.0005 * f64::from(step), 0.0];
        careless.publish(JointState { position, ..JointState::default() }).unwrap();
    });
    assert!(!robot.moved_since(from));
}
