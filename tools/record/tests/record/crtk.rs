//! A recording contains the same as one of a dVRK: standard messages and those of CRTK, and the
//! robot as a URDF.

use std::path::{Path, PathBuf};

use i2ris::ipc::payload::{JointState, OperatingStateMsg, ServoJp};
use i2ris::ipc::{OperatingState, StreamMessage};
use i2ris::units::Nanos;
use i2ris_record::messages::standard::snake;
use i2ris_record::recorder::{RecordingHeader, TrialRecorder};
use i2ris_testing::run_python;
use tempfile::TempDir;

const UNIX: u64 = 1_700_000_000_000_000_000;

/// A robot that is enabled, and then moves.
fn record(path: &Path) {
    let header = RecordingHeader {
        unix_offset_ns: UNIX,
        joints: vec!["pitch".to_owned(), "yaw".to_owned()],
        frame: snake().base(),
        urdf: snake().urdf(),
        ..RecordingHeader::default()
    };
    let mut trial = TrialRecorder::start(path, header).unwrap();
    for number in 1..=100 {
        let stamp = Nanos::from_millis(number);
        let (state, busy) = match number {
            1..20 => (OperatingState::Disabled, false),
            20..30 => (OperatingState::Disabled, true),
            _ => (OperatingState::Enabled, false),
        };
        let busy = if busy { OperatingStateMsg::BUSY } else { 0 };
        let message = OperatingStateMsg {
            sequence: number,
            stamp_ns: stamp.0,
            state: state.number(),
            flags: OperatingStateMsg::HOMED | busy,
            ..OperatingStateMsg::default()
        };
        trial.record(&StreamMessage::State(message), stamp);
        let angles = [0.001 * number as f64, -0.5, 0.0];
        if number > 50 {
            let command = ServoJp {
                sequence: number,
                stamp_ns: stamp.0,
                client_id: 7,
                position: angles,
                count: 2,
                ..ServoJp::default()
            };
            trial.record(&StreamMessage::ServoJp(command), stamp);
        }
        let joints = JointState {
            sequence: number,
            stamp_ns: stamp.0,
            position: angles,
            count: 2,
            flags: JointState::VALID,
            ..JointState::default()
        };
        trial.record(&StreamMessage::Measured(joints), stamp);
    }
    trial.finish(Default::default(), &[]).unwrap();
}

fn recording() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    record(&file);
    (folder, file)
}

/// Checks of both readers, with the messages by topic in `seen`.
const CHECKS: &str = "
import math
states = [f'{m.state} {m.is_homed} {m.is_busy}' for m in seen['/operating_state']]
assert states == ['DISABLED True False', 'DISABLED True True', 'ENABLED True False'], states
stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in seen['/operating_state']]
assert stamps == [1700000000000000000 + k * 1000000 for k in (1, 20, 30)], stamps
servo = seen['/servo_jp']
assert len(servo) == 50 and list(servo[0].name) == ['pitch', 'yaw'], servo
assert abs(servo[0].position[0] - 0.051) < 1e-12 and len(servo[0].velocity) == 0, servo[0]
topics = ['/servo_jp', '/measured_js', '/operating_state']
frames = {m.header.frame_id for topic in topics for m in seen[topic]}
assert frames == {'i2ris_base'}, frames
assert len(seen['/measured_cp']) == len(seen['/tf']) == 5, {k: len(v) for k, v in seen.items()}
tip = seen['/measured_cp'][0]
assert tip.header.frame_id == 'i2ris_base' and tip.pose.position.x < -1e-4, tip
links = {t.child_frame_id: t for t in seen['/tf'][0].transforms}
assert len(links) == 27 and links['i2ris_yaw'].header.frame_id == 'i2ris_base', list(links)
assert abs(links['i2ris_yaw'].transform.rotation.w - math.cos(0.25)) < 1e-12, links['i2ris_yaw']
[description] = seen['/robot_description']
for element in ('<link name=\"i2ris_base\"', '<joint name=\"pitch\"'):
    assert element in description.data, description.data
";

#[test]
fn the_python_package_of_mcap_sees_a_robot_of_crtk() {
    let (_folder, file) = recording();
    let script = "
import sys
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
reader = make_reader(open(sys.argv[1], 'rb'), decoder_factories=[DecoderFactory()])
seen, types = {}, {}
for schema, channel, message, decoded in reader.iter_decoded_messages():
    seen.setdefault(channel.topic, []).append(decoded)
    types[channel.topic] = schema.name
assert types['/operating_state'] == 'crtk_msgs/msg/OperatingState', types
assert types['/servo_jp'] == 'sensor_msgs/msg/JointState', types
[urdf] = [a for a in reader.iter_attachments() if a.name == 'robot.urdf']
assert urdf.data.decode() == seen['/robot_description'][0].data
";
    run_python("mcap, mcap_ros2", &format!("{script}{CHECKS}"), &[file.to_str().unwrap()]);
}

#[test]
fn rosbags_sees_a_robot_of_crtk() {
    let (_folder, file) = recording();
    let script = "
import sys
from pathlib import Path
from rosbags.highlevel import AnyReader
seen = {}
with AnyReader([Path(sys.argv[1])]) as reader:
    for connection, stamp, raw in reader.messages():
        message = reader.deserialize(raw, connection.msgtype)
        seen.setdefault(connection.topic, []).append(message)
";
    run_python("rosbags", &format!("{script}{CHECKS}"), &[file.to_str().unwrap()]);
}
