//! A recording contains the same as one of a dVRK: standard messages and those of CRTK, and the
//! robot as a URDF.

use std::path::{Path, PathBuf};

use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, StreamMessage};
use i2ris::units::Nanos;
use i2ris_needs::needs;
use i2ris_record::messages::standard::snake;
use i2ris_record::recorder::{RecordingHeader, TrialRecorder};
use i2ris_testing::run_python;
use tempfile::TempDir;

use crate::{command, header, joints};

/// A robot that is enabled, and then moves.
fn record(path: &Path) {
    let (frame, urdf) = (snake().base(), snake().urdf());
    let header = RecordingHeader { frame, urdf, ..header() };
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
            trial.record(&command(number, stamp, angles), stamp);
        }
        trial.record(&StreamMessage::Measured(joints(number, stamp, angles)), stamp);
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
fn sees_a_robot(script: &str) {
    let (_folder, file) = recording();
    let script = [script, include_str!("python/crtk_checks.py")].concat();
    run_python(&script, &[file.to_str().unwrap()]);
}

#[needs("python: mcap, mcap_ros2")]
#[test]
fn the_python_package_of_mcap_sees_a_robot_of_crtk() {
    sees_a_robot(include_str!("python/crtk_mcap.py"));
}

#[needs("python: rosbags")]
#[test]
fn rosbags_sees_a_robot_of_crtk() {
    sees_a_robot(include_str!("python/crtk_rosbags.py"));
}
