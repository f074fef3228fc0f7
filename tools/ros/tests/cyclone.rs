//! Interoperation with Cyclone DDS by its Python wheel, with types written out in the example
//! `crtk_arm.py`. Needs a Python with `cyclonedds`: `I2RIS_PYTHON` names one.
use std::path::{Path, PathBuf};
use std::process::Command;

use i2ris::clock;
use i2ris_testing::Rig;

use crate::common::{Bridge, robot};
use crate::peer::ros_domain;

/// Python with the example on its path; `None`, with a message, if there is none.
fn python(ros_domain: u16) -> Option<Command> {
    let mut command = i2ris_testing::python("cyclonedds.sub")?;
    command.env("PYTHONPATH", examples()).env("ROS_DOMAIN_ID", ros_domain.to_string());
    Some(command)
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples")
}

/// Runs Python to its end; returns its output.
fn finish(mut command: Command) -> String {
    let output = command.output().unwrap();
    let (out, err) = (
        String::from_utf8_lossy(&output.stdout).into_owned(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    );
    assert!(output.status.success(), "{out}\n{err}");
    out
}

fn run(arguments: &[&str], script: &str) -> Option<(Rig, Bridge, String)> {
    let domain = ros_domain();
    let mut command = python(domain)?;
    let robot = robot();
    let bridge = Bridge::start(&robot.domain(), domain, arguments);
    command.args(["-c", script]);
    let out = finish(command);
    Some((robot, bridge, out))
}

#[test]
fn the_example_runs_as_it_is() {
    let domain = ros_domain();
    let Some(mut command) = python(domain) else {
        return;
    };
    let robot = robot();
    let bridge = Bridge::start(&robot.domain(), domain, &[]);
    let from = clock::now();
    command.arg(examples().join("crtk_arm.py")).arg("i2ris");
    let out = finish(command);
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines[0], "state: DISABLED", "{out}");
    assert!(lines.contains(&"state: DISABLED") && out.contains("moved to ["), "{out}");
    assert!(robot.moved_since(from));
    let lines = bridge.lines();
    let refused = lines.iter().any(|line| line.starts_with("warning"));
    assert!(!refused, "nothing is refused: {lines:?}");
}

#[test]
fn stored_commands_of_foreign_clients_are_not_carried_out() {
    let domain = ros_domain();
    let Some(mut command) = python(domain) else {
        return;
    };
    let robot = robot();
    command.args([
        "-c",
        "
import sys, time
from crtk_arm import Arm
arm = Arm('i2ris')
arm.state_command('home')
arm.state_command('enable')
arm.move_jp([0.05, 0.0])
print('kept', flush=True)
# Until the robot is running, and some time more.
arm.check_connections(60.0)
time.sleep(4.0)
assert not any(it.is_homed or it.state == 'ENABLED' or it.is_busy for it in arm.states), arm.states
assert arm.home(), arm.lines
",
    ]);
    let child = command
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    clock::sleep(i2ris::units::Nanos::from_millis(5000));
    let bridge = Bridge::start(&robot.domain(), domain, &[]);
    let output = child.wait_with_output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{err}");
    // Cyclone DDS delivers them although they are not requested.
    let lines = bridge.lines();
    let enabled = lines.iter().any(|line| line.contains("enable;"));
    assert!(!enabled, "{lines:?}");
}

#[test]
fn foreign_clients_match_by_quality_of_service() {
    let script = "
import time
from cyclonedds.core import Listener, Policy
from cyclonedds.sub import DataReader
from cyclonedds.pub import DataWriter
from crtk_arm import Arm, JointState, OperatingState, TFMessage, Topic, qos
arm = Arm('i2ris')
arm.check_connections()

class Mismatches(Listener):
    def __init__(self):
        super().__init__()
        self.wrong = []
    def on_requested_incompatible_qos(self, reader, status):
        self.wrong.append(('reader', status.last_policy_id))
    def on_offered_incompatible_qos(self, writer, status):
        self.wrong.append(('writer', status.last_policy_id))

mismatches = Mismatches()
fits = DataReader(arm.participant, arm.topic('measured_js', JointState), qos(reliable=False))
tf = DataReader(arm.participant, Topic(arm.participant, 'rt/tf', TFMessage), qos())
wrong_reader = DataReader(arm.participant, arm.topic('measured_js', JointState), qos(latched=True),
                          listener=mismatches)
wrong_writer = DataWriter(arm.participant, arm.topic('servo_jp', JointState), qos(reliable=False),
                          listener=mismatches)
end = time.time() + 20
while time.time() < end and (len(mismatches.wrong) < 2 or not fits.read(1) or not tf.read(1)):
    time.sleep(0.05)
assert {kind for kind, _ in mismatches.wrong} == {'reader', 'writer'}, mismatches.wrong
assert fits.read(1) and len(tf.take(1)[0].transforms) == 27
arm._wait(20.0, lambda: any('BEST_EFFORT' in it for it in arm.lines['warning']))
print(arm.lines['warning'])
";
    if let Some((_robot, _bridge, out)) = run(&[], script) {
        assert!(out.contains("publishes BEST_EFFORT"), "{out}");
    }
}

#[test]
fn late_foreign_client_gets_latched_messages() {
    let script = "
import time
from crtk_arm import Arm
first = Arm('i2ris')
first.check_connections()
assert first.home() and first.enable(), first.lines
late = Arm('i2ris')
assert late._wait(20.0, lambda: late.states and late.states[-1].state == 'ENABLED'), late.states
assert len(late.states) > 2, late.states
assert late._wait(20.0, lambda: 'the robot is ENABLED' in late.lines['status']), late.lines
stamps = [it.header.stamp.seconds() for it in late.states]
assert stamps == sorted(set(stamps)), stamps
print('done')
";
    if let Some((_robot, _bridge, out)) = run(&[], script) {
        assert!(out.contains("done"), "{out}");
    }
}

#[test]
fn late_foreign_client_with_volatile_reader_can_move() {
    let script = "
import time
from crtk_arm import Arm
first = Arm('i2ris')
first.check_connections()
assert first.home() and first.enable(), first.lines
late = Arm('i2ris', latched=False)
assert late._wait(20.0, lambda: late.operating_state() == 'ENABLED'), late.states
start = time.time()
assert late.enable(5.0), late.lines
assert late._wait(5.0, lambda: late.states[-1].header.stamp.seconds() > start), late.states
assert late.move_jp([0.02, 0.0]).wait(), late.lines
rows = late.jacobian()
assert len(rows) == 6 and rows[1][0] > 1e-4 and rows[0][1] > 1e-4, rows
time.sleep(0.2)
assert abs(late.setpoint_cp().pose.position.y - 0.02 * rows[1][0]) < 1e-6, late.setpoint_cp()
assert abs(late.goal_jp()[0] - 0.02) < 1e-3, late.goal_jp()
assert abs(late.measured_cv().twist.linear.x) < 1.0, late.measured_cv()
late.free()
assert late._wait(10.0, lambda: late.operating_state() == 'DISABLED'), late.states
print('done')
";
    if let Some((_robot, _bridge, out)) = run(&[], script) {
        assert!(out.contains("done"), "{out}");
    }
}

/// Configuration of rmw_cyclonedds for ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST: no interface is
/// named, so Cyclone DDS uses that of the network.
#[test]
fn foreign_client_without_an_interface_finds_the_robot() {
    let domain = ros_domain();
    let Some(mut command) = python(domain) else {
        return;
    };
    let robot = robot();
    let _bridge = Bridge::start(&robot.domain(), domain, &[]);
    command.env(
        "CYCLONEDDS_URI",
        "<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast></General><Discovery>\
         <ParticipantIndex>auto</ParticipantIndex>\
         <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>\
         <Peers><Peer address='localhost'/></Peers></Discovery></Domain></CycloneDDS>",
    );
    let script = "
from crtk_arm import Arm
arm = Arm('i2ris')
arm.check_connections(20.0)
assert arm.home() and arm.enable(), arm.lines
assert arm.move_jp([0.02, 0.0]).wait(), arm.lines
print('done')
";
    let out = finish({
        command.args(["-c", script]);
        command
    });
    assert!(out.contains("done"), "{out}");
}

#[test]
fn services_answer_as_cyclone_dds_asks() {
    let script = "
import time
from dataclasses import dataclass
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, int64, uint8, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from crtk_arm import Arm, OperatingState, Topic, qos

@dataclass
class Request(IdlStruct, typename='crtk_msgs::srv::dds_::TriggerOperatingState_Request_'):
    guid: uint64
    sequence: int64
    structure_needs_at_least_one_member: uint8 = 0

@dataclass
class Response(IdlStruct, typename='crtk_msgs::srv::dds_::TriggerOperatingState_Response_'):
    guid: uint64
    sequence: int64
    operating_state: OperatingState

arm = Arm('i2ris')
arm.check_connections()
assert arm._wait(20.0, lambda: arm.states[-1].state == 'DISABLED'), arm.states
ask = DataWriter(arm.participant,
    Topic(arm.participant, 'rq/i2ris/operating_stateRequest', Request), qos())
answer = DataReader(arm.participant,
    Topic(arm.participant, 'rr/i2ris/operating_stateReply', Response), qos())
end, found = time.time() + 20, []
while time.time() < end and not found:
    ask.write(Request(guid=0x1234567890abcdef, sequence=7))
    time.sleep(0.3)
    found = [it for it in answer.take(10) if hasattr(it, 'guid')]
print(found[0].sequence, hex(found[0].guid), found[0].operating_state.state)
";
    if let Some((_robot, _bridge, out)) = run(&["--rmw", "rmw_cyclonedds_cpp"], script) {
        assert_eq!(out.trim(), "7 0x1234567890abcdef DISABLED");
    }
}

/// For `cargo test -p i2ris-ros --release --test ros -- --ignored --nocapture campaign`:
/// seconds in `I2RIS_SOAK_S`, default one minute.
#[test]
#[ignore = "takes a minute"]
fn campaign_a_kilohertz_without_gaps_and_with_flat_memory() {
    let domain = ros_domain();
    let Some(mut command) = python(domain) else {
        return;
    };
    let seconds = std::env::var("I2RIS_SOAK_S").map_or(60, |seconds| seconds.parse().unwrap());
    let robot = robot();
    let bridge = Bridge::start(&robot.domain(), domain, &["--rate-hz", "1000"]);
    command.args(["-c", &format!("SECONDS = {seconds}\n{KILOHERTZ}")]);
    let child = command.stdout(std::process::Stdio::piped()).spawn().unwrap();
    let (mut memory, start) = (Vec::new(), clock::now());
    while (clock::now() - start).as_seconds() < f64::from(seconds) + 10.0 {
        clock::sleep(i2ris::units::Nanos::from_millis(5000));
        memory.push(bridge.memory_kb());
    }
    let output = child.wait_with_output().unwrap();
    eprintln!("{}", String::from_utf8_lossy(&output.stdout));
    assert!(output.status.success());
    eprintln!("resident memory of i2ris-ros every 5 s, kB: {memory:?}");
    let (early, late) = (memory[2], memory[memory.len() - 2]);
    assert!(late < early + 4096, "memory grows: {memory:?}");
}

/// Watches `measured_js` at 1 kHz and sends commands at 1 kHz. Lost: samples that the reader
/// missed. Steps: between the stamps of two samples; the sender publishes by its own clock, so an
/// estimate can be repeated or skipped. Without one, as after a fault, the stamp is 0.
const KILOHERTZ: &str = r#"
import math, threading, time
from cyclonedds.core import Listener
from cyclonedds.sub import DataReader
from crtk_arm import Arm, JointState, qos

class Losses(Listener):
    count = 0
    def on_sample_lost(self, reader, status):
        Losses.count = status.total_count

arm = Arm('i2ris')
arm.check_connections()
assert arm.home() and arm.enable(), arm.lines
reader = DataReader(arm.participant, arm.topic('measured_js', JointState), qos(depth=5000),
                    listener=Losses())
end, sent = time.time() + SECONDS, 0
def send():
    global sent
    start = time.time()
    while time.time() < end:
        t = time.time() - start
        arm.servo_jp([0.05 * math.sin(t), 0.04 * math.sin(1.3 * t)])
        sent += 1
        time.sleep(max(0.0, start + sent * 0.001 - time.time()))
sender = threading.Thread(target=send)
sender.start()
received, last, longest, over_ms = 0, 0, 0.0, {2: 0, 5: 0, 20: 0}
repeated = invalid = 0
while time.time() < end:
    for sample in reader.take(5000):
        if hasattr(sample, 'position'):
            stamp = sample.header.stamp.sec * 10**9 + sample.header.stamp.nanosec
            received, invalid = received + 1, invalid + (stamp == 0)
            step_ms = (stamp - last) * 1e-6 if stamp and last else 1.0
            last, longest = stamp, max(longest, step_ms)
            repeated += step_ms <= 0.0
            for limit in over_ms:
                over_ms[limit] += step_ms > limit
    time.sleep(0.01)
sender.join()
warnings = arm.lines["warning"]
print(f"{received} messages in {SECONDS} s; lost: {Losses.count}; repeated: {repeated};",
      f"invalid: {invalid};",
      f"longest step {longest:.1f} ms, steps over a number of ms: {over_ms};",
      f"{sent} commands sent; warnings: {warnings[-5:]}")
assert Losses.count == 0 and received > 0
"#;
