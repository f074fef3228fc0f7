//! The run log: one JSON object per line for every start and end of the controller and every state
//! change with its cause. Lines are only ever appended. `write_line` is for the operator log.

use std::fmt;
use std::fs::{DirBuilder, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, FileExt, OpenOptionsExt};

use nix::libc;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::config::Config;
use crate::core::{CycleEvent, CycleEventKind};
use crate::drive::AxisIdentity;
use crate::model::ModelId;
use crate::realtime::Granted;
use crate::robot::{DriveFingerprint, Fault};
use crate::units::Nanos;
use crate::{clock, wall_clock};

/// Name of the file in the folder of the records.
pub const FILE: &str = "runs.jsonl";

#[derive(Debug)]
pub struct RunHeader<'a> {
    pub software: &'a str,
    pub boot_id: u64,
    pub config: &'a Config,
    pub model: Option<ModelId>,
    pub drives: &'a [AxisIdentity],
    pub fingerprints: &'a [DriveFingerprint],
    pub granted: &'a Granted,
    pub note: &'a str,
}

/// The log of one run. Without a file it writes nothing: a full disk does not stop the robot.
#[derive(Debug)]
pub struct RunLog {
    file: Option<File>,
    boot_id: u64,
}

impl RunLog {
    /// Opens the log and writes the header of a run. Fails when the file cannot be written. The
    /// result then contains a log that writes nothing.
    pub fn begin(run: &RunHeader<'_>) -> (Self, io::Result<()>) {
        let boot_id = run.boot_id;
        let mut log = Self { file: None, boot_id };
        let opened = open(run.config).and_then(|file| {
            log.file = Some(file);
            log.write("begin", header(run))
        });
        (log, opened)
    }

    /// Writes an event if it belongs to the run log: changes of state, model and lease, stops after
    /// a deadline, drive errors. `client`: process that took a lease, if known.
    pub(crate) fn write_event(
        &mut self,
        event: &CycleEvent,
        client: Option<&str>,
    ) -> io::Result<()> {
        let Some((name, fields)) = event_fields(&event.kind, client) else {
            return Ok(());
        };
        let mut first = json!({ "monotonic_ns": event.stamp.0 });
        if let Some(reason) = event.reason() {
            first = merge(first, json!({ "reason": reason.text() }));
        }
        self.write(name, merge(first, fields))
    }

    /// Writes the end of the run. Fails when the file cannot be written.
    pub fn end(&mut self, outcome: &str) -> io::Result<()> {
        self.write("end", json!({ "outcome": outcome }))
    }

    fn write(&mut self, event: &str, fields: Value) -> io::Result<()> {
        let Some(file) = &mut self.file else { return Ok(()) };
        let run = format!("{:016x}", self.boot_id);
        let time = wall_clock::now().to_string();
        let line = merge(json!({ "run": run, "time": time, "event": event }), fields);
        // A single call, so that lines of two controllers are never mixed.
        file.write_all(format!("{line}\n").as_bytes())
    }
}

fn open(config: &Config) -> io::Result<File> {
    let folder = &config.record_folder;
    if !folder.is_dir() {
        DirBuilder::new().recursive(true).mode(0o700).create(folder)?;
    }
    // A FIFO or a device under this name would block the main thread.
    let mut file = OpenOptions::new()
        .read(true)
        .append(true)
        .create(true)
        .mode(0o600)
        .custom_flags(libc::O_NONBLOCK | libc::O_NOFOLLOW)
        .open(folder.join(FILE))?;
    let metadata = file.metadata()?;
    if !metadata.is_file() {
        return Err(io::Error::other(format!("{FILE} is not a regular file")));
    }
    let mut last = *b"\n";
    if let Some(at) = metadata.len().checked_sub(1) {
        file.read_exact_at(&mut last, at)?;
    }
    // A power cut may have torn the last line, and a reader skips it with what follows.
    if last != *b"\n" {
        file.write_all(b"\n")?;
    }
    Ok(file)
}

fn header(run: &RunHeader<'_>) -> Value {
    let text = toml::to_string(run.config).unwrap_or_default();
    let drives: Vec<Value> = run.drives.iter().map(|axis| drive(axis, run.fingerprints)).collect();
    json!({
        "software": run.software,
        "config_sha256": ModelId(Sha256::digest(text.as_bytes()).into()).to_string(),
        "robot_id": run.config.robot_id,
        "model": run.model.map(|model| model.to_string()),
        "drives": drives,
        "real_time": {
            "fifo_priority": run.granted.priority,
            "processor": run.granted.cpu,
            "memory_locked": run.granted.memory_locked,
            "warnings": run.granted.warnings,
        },
        "note": run.note,
    })
}

fn drive(axis: &AxisIdentity, fingerprints: &[DriveFingerprint]) -> Value {
    let fingerprint = fingerprints.iter().find(|drive| drive.motor == axis.motor);
    json!({
        "motor": axis.motor,
        "serial_number": axis.serial_number,
        "full_serial_number": axis.full_serial_number.map(|number| format!("{number:X}")),
        "firmware": format!("{:04X}", axis.model.firmware),
        "name": axis.name,
        "settings": fingerprint.map(|drive| &drive.settings),
    })
}

/// Name and fields of an event that belongs to the run log.
fn event_fields(kind: &CycleEventKind, client: Option<&str>) -> Option<(&'static str, Value)> {
    let id = |client_id: &u64| format!("{client_id:016x}");
    Some(match kind {
        CycleEventKind::State { from, to, command, fault } => {
            let command = command.map(|command| command.text());
            let fault = (*fault != Fault::None).then(|| fault.text());
            let (from, to) = (from.text(), to.text());
            ("state", json!({ "from": from, "to": to, "command": command, "fault": fault }))
        }
        CycleEventKind::Model { from, to } => {
            let from = from.map(|from| from.to_string());
            ("model", json!({ "from": from, "to": to.to_string() }))
        }
        CycleEventKind::Lease { client_id } => {
            ("lease", json!({ "client": id(client_id), "caller": client }))
        }
        CycleEventKind::StaleStop { client_id, age } => {
            let silent_ms = age.as_seconds() * 1e3;
            ("stop", json!({ "client": id(client_id), "silent_ms": silent_ms }))
        }
        CycleEventKind::LimitStop { client_id, limit } => {
            ("stop", json!({ "client": id(client_id), "limit": limit.text() }))
        }
        CycleEventKind::Axis { motor, to, error_code, .. } if *error_code != 0 => {
            let (phase, code) = (format!("{to:?}"), format!("{error_code:04X}"));
            ("drive", json!({ "motor": motor, "phase": phase, "error_code": code }))
        }
        CycleEventKind::Plausibility(check) => {
            ("plausibility", json!({ "check": format!("{check:?}") }))
        }
        CycleEventKind::OtherCamera { frames } => {
            ("other camera", json!({ "ignored_frames": frames }))
        }
        CycleEventKind::Fixtures { client_id, active } => {
            ("fixtures", json!({ "client": id(client_id), "active": active }))
        }
        CycleEventKind::Adaptation(event) => {
            ("adaptation", json!({ "event": format!("{event:?}") }))
        }
        CycleEventKind::FeedbackStop(_) => ("stop", json!({})),
        CycleEventKind::Axis { .. }
        | CycleEventKind::Clipped { .. }
        | CycleEventKind::FixtureLimit { .. }
        | CycleEventKind::Refused { .. }
        | CycleEventKind::RequestRefused { .. } => return None,
    })
}

fn merge(mut first: Value, second: Value) -> Value {
    if let (Value::Object(first), Value::Object(second)) = (&mut first, second) {
        first.extend(second);
    }
    first
}

/// Writes one line with the time. A closed or full log does not stop the robot.
pub(crate) fn write_line(log: &mut dyn Write, line: fmt::Arguments<'_>) {
    let _ = writeln!(log, "{}", stamped_line(clock::now(), line));
}

/// A line with the wall clock and the monotonic clock of `stamp`.
pub(super) fn stamped_line(stamp: Nanos, line: fmt::Arguments<'_>) -> String {
    let wall = wall_clock::ago(clock::now().duration_since(stamp));
    format!("{wall} [{:12.6}] {line}", stamp.as_seconds())
}
