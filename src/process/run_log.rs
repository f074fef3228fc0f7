//! The log of runs: what ran, on what, and every change of state with its cause. JSON, one object a
//! line, only ever added to.

use std::fs::{DirBuilder, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::config::Config;
use crate::core::{CycleEvent, CycleEventKind};
use crate::drive::AxisIdentity;
use crate::model::ModelId;
use crate::realtime::Granted;
use crate::robot::Fault;
use crate::wall_clock;

/// Name of the file in the folder of the records.
pub const FILE: &str = "runs.jsonl";

/// What a run is known by.
#[derive(Debug)]
pub struct Run<'a> {
    /// Version and commit.
    pub software: &'a str,
    /// This start of the controller.
    pub boot_id: u64,
    /// The configuration in use.
    pub config: &'a Config,
    /// The model in use at the start.
    pub model: Option<ModelId>,
    /// The drives that were found.
    pub drives: &'a [AxisIdentity],
    /// What the loop was granted.
    pub granted: &'a Granted,
    /// What the operator had to say.
    pub note: &'a str,
}

/// The log of one run. Without a file it writes nothing: a full disk does not stop the robot.
#[derive(Debug)]
pub struct Audit {
    file: Option<File>,
    boot_id: u64,
}

impl Audit {
    /// Opens the log and writes the header of a run.
    ///
    /// # Errors
    ///
    /// When the file cannot be written. The answer then comes with a log that writes nothing.
    pub fn begin(run: &Run<'_>) -> (Self, io::Result<()>) {
        let mut audit = Self {
            file: None,
            boot_id: run.boot_id,
        };
        let opened = open(run.config).and_then(|file| {
            audit.file = Some(file);
            audit.write(header(run))
        });
        (audit, opened)
    }

    /// Writes what is worth keeping of an event: changes of state and of the model, who commands,
    /// and stops for silence. `caller` is who a lease went to, if that is known.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn note(&mut self, event: &CycleEvent, caller: Option<&str>) -> io::Result<()> {
        let Some(what) = worth_keeping(&event.kind, caller) else {
            return Ok(());
        };
        let when = json!({ "run": run_name(self.boot_id), "time": wall_clock::now().to_string(), "monotonic_ns": event.stamp.0 });
        self.write(merged(when, what))
    }

    /// Writes that the run has ended.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn end(&mut self, outcome: &str) -> io::Result<()> {
        let time = wall_clock::now().to_string();
        self.write(json!({ "run": run_name(self.boot_id), "time": time, "event": "end", "outcome": outcome }))
    }

    fn write(&mut self, line: Value) -> io::Result<()> {
        match &mut self.file {
            // One call, so that two controllers never mix their lines.
            Some(file) => file.write_all(format!("{line}\n").as_bytes()),
            None => Ok(()),
        }
    }
}

fn open(config: &Config) -> io::Result<File> {
    let folder = &config.record.folder;
    if !folder.is_dir() {
        DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(folder)?;
    }
    OpenOptions::new()
        .append(true)
        .create(true)
        .mode(0o600)
        .open(folder.join(FILE))
}

fn run_name(boot_id: u64) -> String {
    format!("{boot_id:016x}")
}

fn header(run: &Run<'_>) -> Value {
    let text = toml::to_string(run.config).unwrap_or_default();
    let drives: Vec<Value> = run.drives.iter().map(drive).collect();
    json!({
        "run": run_name(run.boot_id),
        "time": wall_clock::now().to_string(),
        "event": "begin",
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

fn drive(axis: &AxisIdentity) -> Value {
    json!({
        "motor": axis.motor,
        "serial_number": axis.serial_number,
        "full_serial_number": axis.full_serial_number.map(|number| format!("{number:X}")),
        "firmware": format!("{:04X}", axis.firmware),
        "name": axis.name,
    })
}

fn worth_keeping(kind: &CycleEventKind, caller: Option<&str>) -> Option<Value> {
    match kind {
        CycleEventKind::State {
            from,
            to,
            command,
            fault,
        } => Some(json!({
            "event": "state",
            "from": from.text(),
            "to": to.text(),
            "command": command.map(|command| command.text()),
            "fault": (*fault != Fault::None).then(|| fault.text()),
        })),
        CycleEventKind::Model { from, to } => Some(json!({
            "event": "model",
            "from": from.map(|from| from.to_string()),
            "to": to.to_string(),
        })),
        CycleEventKind::Lease { client_id } => Some(
            json!({ "event": "lease", "client": format!("{client_id:016x}"), "caller": caller }),
        ),
        CycleEventKind::StaleStop { client_id, age } => Some(json!({
            "event": "stop", "client": format!("{client_id:016x}"), "silent_ms": age.as_seconds() * 1e3,
        })),
        CycleEventKind::Axis {
            motor,
            to,
            error_code,
            ..
        } if *error_code != 0 => Some(json!({
            "event": "drive", "motor": motor, "phase": format!("{to:?}"), "error_code": format!("{error_code:04X}"),
        })),
        CycleEventKind::Axis { .. } | CycleEventKind::Refused { .. } => None,
    }
}

fn merged(mut first: Value, second: Value) -> Value {
    if let (Value::Object(first), Value::Object(second)) = (&mut first, second) {
        first.extend(second);
    }
    first
}
