//! Recordings and their reports.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "tests, which report when they skip"
)]

mod crtk;
mod export;
mod files;
mod interfaces;
mod pictures;
mod programs;
mod reasons;
mod trial;
mod trial_faults;

use i2ris::ipc::payload::JointState;
use i2ris::units::Nanos;
use i2ris_record::recorder::RecordingHeader;

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

const UNIX: u64 = 1_700_000_000_000_000_000;

/// Head of a recording: the robot bends in pitch and yaw.
fn header() -> RecordingHeader {
    RecordingHeader {
        unix_offset_ns: UNIX,
        joints: vec!["pitch".to_owned(), "yaw".to_owned()],
        ..RecordingHeader::default()
    }
}
