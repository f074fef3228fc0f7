//! Recordings and their reports.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "tests, which report when they skip"
)]

mod export;
mod files;
mod interfaces;
mod pictures;
mod programs;
mod trial;
mod trial_faults;

use std::path::{Path, PathBuf};

use i2ris::ipc::StreamMessage;
use i2ris::ipc::payload::{ActuatorState, ExternalPosition, JointState, ServoJp};
use i2ris::units::Nanos;
use i2ris_record::recorder::RecordingHeader;
use tempfile::TempDir;

/// Valid angles, rad.
fn joints(sequence: u64, stamp: Nanos, position: [f64; 3]) -> JointState {
    JointState {
        sequence,
        stamp_ns: stamp.0,
        position,
        count: 2,
        flags: JointState::VALID,
        ..JointState::default()
    }
}

fn motors(sequence: u64, stamp: Nanos, measured_counts: [i32; 2]) -> StreamMessage {
    let stamp_ns = stamp.0;
    let state = ActuatorState { sequence, stamp_ns, measured_counts, ..Default::default() };
    StreamMessage::Actuators(state)
}

/// Angles that a camera saw, rad.
fn camera(stamp: Nanos, [pitch, yaw]: [f64; 2]) -> StreamMessage {
    StreamMessage::External(ExternalPosition {
        stamp_ns: stamp.0,
        position: [pitch, yaw, 0.0],
        count: 2,
        flags: ExternalPosition::VALID,
        ..ExternalPosition::default()
    })
}

/// A command of client 7, rad.
fn command(sequence: u64, stamp: Nanos, position: [f64; 3]) -> StreamMessage {
    let (stamp_ns, client_id, count) = (stamp.0, 7, 2);
    let command = ServoJp { sequence, stamp_ns, client_id, position, count, ..ServoJp::default() };
    StreamMessage::ServoJp(command)
}

const UNIX: u64 = 1_700_000_000_000_000_000;

/// Head of a recording: the robot bends in pitch and yaw.
fn header() -> RecordingHeader {
    RecordingHeader {
        unix_offset_ns: UNIX,
        joints: vec!["pitch".to_owned(), "yaw".to_owned()],
        ..RecordingHeader::default()
    }
}

/// A folder with the recording `a.mcap`.
fn recording(record: fn(&Path)) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    record(&file);
    (folder, file)
}
