//! Requirements of CRTK for a robot: its states, joints and tip, and its services.

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_report::snake::{Bend, Snake};
use i2ris_ros::message::{
    Empty, IntervalStatistics, JointState, MultiArray, NoRequest, PoseStamped,
    QueryForwardKinematics, QueryForwardKinematicsResponse, QueryInverseKinematics,
    QueryInverseKinematicsResponse, Time, Transforms, TriggerOperatingStateResponse,
    TriggerResponse, TwistStamped,
};
use i2ris_testing::wait_until;
use ros2_client::qos::Durability;
use ros2_client::{Message, Name, ServiceMapping, ServiceTypeName, Subscription};

use crate::common::{Peer, ROBOT, enabled, qos, repeat, start};

#[test]
fn repeated_state_command_republishes_state() {
    let (_robot, bridge, mut peer) = enabled();
    for word in ["enable", "resume", "home", "pause", "pause", "disable", "disable"] {
        let sent = i2ris::wall_clock::unix_time().0;
        peer.command(word);
        peer.wait_for(word, |state| state.header.stamp.unix_ns() > Some(sent));
        let state = if word == "pause" { "PAUSED" } else { "ENABLED" };
        let state = if word == "disable" { "DISABLED" } else { state };
        peer.wait_for(word, |found| found.state == state && !found.is_busy);
    }
    let lines = bridge.lines();
    assert!(!lines.iter().any(|line| line.starts_with("warning")), "{lines:?}");
}

#[test]
fn joints_are_matched_by_name_and_foreign_names_refused() {
    let (robot, _bridge, mut peer) = enabled();
    let named = |names: [&str; 2], degrees: [f64; 2]| JointState {
        name: names.map(str::to_owned).to_vec(),
        position: degrees.map(f64::to_radians).to_vec(),
        ..JointState::default()
    };
    peer.send_message("move_jp", named(["yaw", "pitch"], [-2.0, 4.0]));
    peer.wait_for_motion();
    let [pitch, yaw] = peer.setpoint_degrees();
    assert!((pitch - 4.0).abs() < 0.2 && (yaw + 2.0).abs() < 0.2, "{pitch} {yaw}");
    robot.wait_until_still();
    let from = clock::now();
    for names in [["outer_yaw", "outer_pitch"], ["pitch", "pitch"]] {
        peer.send_message("move_jp", named(names, [1.0, 1.0]));
        let line = peer.wait_for_line("warning", "the joints of this robot are pitch and yaw");
        assert!(line.contains("/console: move_jp: "), "{line}");
        peer.lines.clear();
        clock::sleep(Nanos::from_millis(1100));
    }
    let foreign = || named(["outer_yaw", "outer_pitch"], [4.5, -2.0]);
    repeat(20, 5, |_| peer.send_message("servo_jp", foreign()));
    peer.wait_for_line("warning", "servo_jp: it names \"outer_yaw\"");
    assert!(!robot.moved_since(from));
}

#[test]
fn a_velocity_that_is_not_used_is_reported_once() {
    let (_robot, _bridge, mut peer) = enabled();
    let goal = |velocity| JointState {
        position: vec![0.0; 2],
        velocity: vec![velocity; 2],
        ..JointState::default()
    };
    for velocity in [0.0, 0.1, 0.2, 0.3] {
        repeat(2, 20, |_| peer.send_message("servo_jp", goal(velocity)));
    }
    peer.wait_for_line("warning", "/console: servo_jp: its velocity is not used");
    clock::sleep(Nanos::from_millis(1500));
    peer.update();
    let lines = peer.lines.iter().filter(|(_, line)| line.contains("velocity"));
    assert_eq!(lines.count(), 1, "{:?}", peer.lines);
}

#[test]
fn the_tip_and_the_frames_are_those_of_the_bend() {
    let (_robot, _bridge, mut peer) = enabled();
    let frames: Subscription<Transforms> = peer.subscription("/tf");
    peer.send_degrees("move_jp", [8.0, 0.0]);
    peer.wait_for_motion();
    let tip = peer.next_tip(|tip| tip.header.stamp != Time::INVALID);
    let [pitch, yaw] = peer.measured_degrees();
    let bend = Bend { pitch: pitch.to_radians(), yaw: yaw.to_radians() };
    let expected = Snake::new(ROBOT).tip_pose(bend);
    let found = [tip.pose.position.x, tip.pose.position.y, tip.pose.position.z];
    for (found, expected) in found.iter().zip(expected.position_m) {
        assert!((found - expected).abs() < 2e-5, "{found} {expected}");
    }
    assert!(tip.pose.position.y > 1e-4, "it is bent: {tip:?}");
    let (Transforms { transforms }, _) = wait_until("frames", || frames.take().ok().flatten());
    assert_eq!(transforms.len(), 27, "all links but the base");
    for master in ["i2ris_pitch", "i2ris_yaw"] {
        assert!(transforms.iter().any(|it| it.child_frame_id == master), "{master}");
    }
    assert_eq!(transforms[0].header.frame_id, "i2ris_base");
}

#[test]
fn tip_topics_and_loop_statistics_are_published() {
    let (_robot, _bridge, mut peer) = enabled();
    let setpoints: Subscription<PoseStamped> = peer.subscription("setpoint_cp");
    let goals: Subscription<JointState> = peer.subscription("goal_js");
    let twists: Subscription<TwistStamped> = peer.subscription("measured_cv");
    let jacobians: Subscription<MultiArray> = peer.subscription("jacobian");
    let statistics: Subscription<IntervalStatistics> = peer.subscription("period_statistics");
    peer.send_degrees("move_jp", [8.0, -3.0]);
    // While it moves, along the bend.
    let moving = wait_until("a velocity", || {
        let (twist, _) = twists.take().ok().flatten()?;
        (twist.linear.y > 1e-4 && twist.angular.x < -1e-2).then_some(twist)
    });
    assert_eq!(moving.header.frame_id, "i2ris_base");
    peer.wait_for("it has moved", |state| !state.is_busy);
    let snake = Snake::new(ROBOT);
    let bend = Bend { pitch: 8.0_f64.to_radians(), yaw: (-3.0_f64).to_radians() };
    let there = snake.tip_pose(bend).position_m;
    wait_until("the setpoint of the tip is that of the goal", || {
        let position = setpoints.take().ok().flatten()?.0.pose.position;
        let found = [position.x, position.y, position.z];
        found.iter().zip(there).all(|(found, wanted)| (found - wanted).abs() < 1e-5).then_some(())
    });
    wait_until("the goal", || {
        let goal = goals.take().ok().flatten()?.0.position;
        (goal.len() == 2 && (goal[0] - bend.pitch).abs() < 1e-3).then_some(())
    });
    let expected = snake.jacobian(bend);
    wait_until("the jacobian, row by row", || {
        let found = jacobians.take().ok().flatten()?.0;
        let sizes: Vec<u32> = found.dim.iter().map(|it| it.size).collect();
        assert_eq!((sizes.as_slice(), found.data.len()), (&[6, 2][..], 12));
        let near = |place: usize| (found.data[place] - expected[place / 2][place % 2]).abs();
        (0..12).all(|place| near(place) < 1e-2).then_some(())
    });
    let loops = wait_until("statistics", || statistics.take().ok().flatten()).0;
    assert!(loops.number_of_samples > 0 && loops.period_avg > 1e-4, "{loops:?}");
    assert!(loops.period_avg < loops.period_max && loops.period_min.is_nan(), "{loops:?}");
}

#[test]
fn a_pose_right_after_a_hold_is_not_refused() {
    let (_robot, bridge, mut peer) = enabled();
    // Enabling repeats the request until it is done, and may be refused as busy.
    let enabled = bridge.lines().len();
    for _ in 0..10 {
        let [pitch, yaw] = peer.setpoint_degrees();
        peer.stream(|t| (t < 0.3).then_some([pitch + t, yaw]));
        let before = peer.seen.len();
        peer.hold();
        peer.send_degrees("move_jp", [pitch, yaw]);
        wait_until("busy, then not busy", || {
            peer.update();
            let busy: Vec<bool> = peer.seen[before..].iter().map(|it| it.is_busy).collect();
            busy.contains(&true) && busy.ends_with(&[false])
        });
    }
    let lines = bridge.lines().split_off(enabled);
    assert!(!lines.iter().any(|line| line.contains("refused")), "{lines:?}");
}

#[test]
fn free_takes_the_power_off_the_motors() {
    let (_robot, _bridge, mut peer) = start();
    let free = peer.publisher::<Empty>("free");
    peer.enable();
    free.publish(Empty::default()).unwrap();
    peer.wait_for("off", |state| state.state == "DISABLED" && !state.is_busy);
    peer.wait_for_line("status", "/console: disable");
}

/// Sends something for two seconds.
fn for_two_seconds(mut send: impl FnMut(f64)) {
    repeat(100, 20, |number| send(f64::from(number) * 0.02));
}

#[test]
fn rates_move_the_snake_and_zero_stops_it() {
    let (robot, _bridge, mut peer) = enabled();
    let rate = |pitch_deg: f64| JointState {
        velocity: vec![pitch_deg.to_radians(), 0.0],
        ..JointState::default()
    };
    for_two_seconds(|t| {
        peer.send_message("servo_jv", rate(if t < 1.6 { 4.0 } else { 0.0 }));
    });
    let [pitch, yaw] = peer.setpoint_degrees();
    assert!((4.0..9.0).contains(&pitch) && yaw.abs() < 0.3, "{pitch} {yaw}");
    robot.wait_until_still();
    // Ten times a second.
    wait_until("goals ten times a second are followed", || {
        let [from, _] = peer.setpoint_degrees();
        repeat(20, 100, |number| {
            peer.send_degrees("interpolate_jp", [from - 0.1 * f64::from(number), 0.0]);
        });
        robot.wait_until_still();
        let [pitch, _] = peer.setpoint_degrees();
        let is_there = (pitch - (from - 1.9)).abs() < 0.3;
        if !is_there {
            // A stream that came late on a busy computer begins again after a silence.
            clock::sleep(Nanos::from_millis(1100));
            peer.hold();
        }
        is_there
    });
    peer.send_message("servo_jv", JointState { velocity: vec![0.1], ..JointState::default() });
    peer.wait_for_line("warning", "servo_jv: 1 positions for 2 joints");
    let wrong = JointState { velocity: vec![f64::NAN, 0.0], ..JointState::default() };
    peer.send_message("servo_jv", wrong);
    peer.wait_for_line("warning", "servo_jv: a position is not finite");
}

#[test]
fn tip_goals_are_accepted_in_the_base_frame_only() {
    let (robot, _bridge, mut peer) = start();
    let servo = peer.publisher::<PoseStamped>("servo_cp");
    let moves = peer.publisher::<PoseStamped>("move_cp");
    let twists = peer.publisher::<TwistStamped>("servo_cv");
    peer.enable();
    let snake = Snake::new(ROBOT);
    let at = |pitch_deg: f64, frame: &str| {
        let bend = Bend { pitch: pitch_deg.to_radians(), yaw: 0.0 };
        let mut message = PoseStamped::default();
        message.header.frame_id = frame.to_owned();
        message.pose.position = snake.tip_pose(bend).position_m.into();
        message
    };
    let gone = |peer: &mut Peer, pitch_deg: f64| {
        wait_until("it has gone there", || {
            peer.update();
            (peer.setpoint_degrees()[0] - pitch_deg).abs() < 0.2
        });
    };
    moves.publish(at(5.0, "i2ris_base")).unwrap();
    gone(&mut peer, 5.0);
    robot.wait_until_still();
    for_two_seconds(|t| servo.publish(at(5.0 + t.min(1.5), "")).unwrap());
    gone(&mut peer, 6.5);
    let mut back = TwistStamped::default();
    back.linear.y = -2e-4;
    for_two_seconds(|_| twists.publish(back.clone()).unwrap());
    assert!(peer.setpoint_degrees()[0] < 6.0, "{:?}", peer.setpoint_degrees());
    robot.wait_until_still();
    let from = clock::now();
    moves.publish(at(3.0, "camera")).unwrap();
    peer.wait_for_line("warning", "move_cp: it is in frame \"camera\"");
    let mut nowhere = at(3.0, "");
    nowhere.pose.position.x = f64::NAN;
    servo.publish(nowhere).unwrap();
    peer.wait_for_line("warning", "servo_cp: a position is not finite");
    let mut far = at(3.0, "");
    far.pose.position.z += 2e-3;
    moves.publish(far).unwrap();
    let line = peer.wait_for_line("warning", "out of reach");
    assert!(line.contains(" mm"), "{line}");
    assert!(!robot.moved_since(from));
}

#[test]
fn jaw_has_its_own_topics() {
    let (_robot, _bridge, mut peer) = start();
    let seen: Subscription<JointState> = peer.subscription("jaw/measured_js");
    let jaw = peer.publisher::<JointState>("jaw/servo_jp");
    peer.enable();
    let to = |angles: &[f64]| {
        let message = JointState { position: angles.to_vec(), ..JointState::default() };
        jaw.publish(message).unwrap();
    };
    for_two_seconds(|t| to(&[0.1 * t.min(1.5)]));
    let there = wait_until("its angle", || {
        let angle = seen.take().ok().flatten()?.0;
        (angle.name == ["jaw"] && angle.position.first()? > &0.1).then_some(angle)
    });
    assert!(there.velocity.is_empty(), "{there:?}");
    to(&[0.1, 0.1]);
    peer.wait_for_line("warning", "jaw/servo_jp: 2 positions for 1 joints");
}

#[test]
fn unsupported_features_have_no_topic() {
    let (_robot, _bridge, mut peer) = start();
    peer.connect();
    for topic in ["servo_jf", "servo_cf", "servo_cr", "move_cr", "servo_cs", "measured_cf"] {
        let name = format!("/{ROBOT}/{topic}");
        let both = (peer.node.subscription_count(&name), peer.node.publisher_count(&name));
        assert_eq!(both, (0, 0), "{name}");
    }
}

#[test]
fn the_services_answer() {
    let (_robot, _bridge, mut peer) = start();
    peer.connect();
    let nothing = NoRequest::default();
    let version = |it: &TriggerResponse| it.success && it.message.starts_with("1.");
    ask(&mut peer, "crtk_version", ("std_srvs", "Trigger"), &nothing, version);
    let state = |answer: &TriggerOperatingStateResponse| answer.operating_state.state == "DISABLED";
    let trigger = ("crtk_msgs", "TriggerOperatingState");
    ask(&mut peer, "operating_state", trigger, &nothing, state);
    let forward = ("crtk_msgs", "QueryForwardKinematics");
    let request = QueryForwardKinematics { jp: vec![0.2, -0.1], ..Default::default() };
    let there = |answer: &QueryForwardKinematicsResponse| answer.result;
    let there = ask(&mut peer, "forward_kinematics", forward, &request, there);
    let tip = Snake::new(ROBOT).tip_pose(Bend { pitch: 0.2, yaw: -0.1 });
    assert_eq!(there.cp.position, tip.position_m.into());
    let request = QueryForwardKinematics { jp: vec![0.2], ..Default::default() };
    let refused = |answer: &QueryForwardKinematicsResponse| {
        !answer.result && answer.message == "1 positions for 2 joints"
    };
    ask(&mut peer, "forward_kinematics", forward, &request, refused);
    let inverse = ("crtk_msgs", "QueryInverseKinematics");
    let mut request = QueryInverseKinematics { cp: there.cp, jp: Vec::new() };
    let back = |answer: &QueryInverseKinematicsResponse| {
        let near = |joint: usize, angle: f64| (answer.jp[joint] - angle).abs() < 1e-6;
        answer.result && near(0, 0.2) && near(1, -0.1)
    };
    ask(&mut peer, "inverse_kinematics", inverse, &request, back);
    request.cp.position.z += 1e-3;
    let far = |answer: &QueryInverseKinematicsResponse| {
        !answer.result && answer.message.starts_with("out of reach")
    };
    ask(&mut peer, "inverse_kinematics", inverse, &request, far);
}

/// Repeats a request until the answer fits: matching takes time, and answers to others also arrive.
fn ask<Q: Message + Clone + 'static, R: Message + 'static>(
    peer: &mut Peer,
    name: &str,
    kind: (&str, &str),
    request: &Q,
    wanted: impl Fn(&R) -> bool,
) -> R {
    let full = Name::parse(&format!("/{ROBOT}/{name}")).unwrap();
    let (kind, qos) = (ServiceTypeName::new(kind.0, kind.1), qos(Durability::Volatile));
    let mapping = ServiceMapping::Enhanced;
    let client = peer.node.create_client::<Q, R>(mapping, &full, &kind, qos.clone(), qos).unwrap();
    let mut sent = Nanos::ZERO;
    wait_until(name, || {
        if clock::now().duration_since(sent) > Nanos::from_millis(1000) {
            let _ = client.send_request(request.clone());
            sent = clock::now();
        }
        client.receive_response().ok().flatten().map(|(_, answer)| answer).filter(&wanted)
    })
}
