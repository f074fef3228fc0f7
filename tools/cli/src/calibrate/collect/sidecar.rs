//! Metadata of a recording, in a TOML file next to it.
//!
//! Written when the recording begins, so that an interrupted one also has it, and again at the end.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use i2ris::robot::DriveFingerprint;
use i2ris_calibration::quality::latency::Latency;
use i2ris_report::{Failure, files::write};
use serde::Serialize;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sidecar {
    pub format: &'static str,
    pub schema_version: u32,
    pub recording: String,
    pub robot_id: String,
    pub software: String,
    pub controller: String,
    /// Identity of the model that the controller had loaded; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_id: Option<String>,
    /// When `t_s` was 0, on the wall clock, seconds since 1970.
    pub started_unix_s: u64,
    pub protocol: ProtocolRecord,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outcome: Option<Outcome>,
    /// Latency of the camera's stamps; absent if it cannot be estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency: Option<LatencyRecord>,
    /// The drive settings; empty if the controller does not report them.
    pub drives: Vec<DriveFingerprint>,
    pub flags: Vec<Flag>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProtocolRecord {
    pub name: &'static str,
    pub seed: u64,
    pub duration_s: f64,
    pub centre_counts: Vec<f64>,
    pub range_counts: f64,
    pub speed_counts_s: f64,
    /// A conditioning cycle came first; it is part of the recording.
    pub conditioned: bool,
    pub limits: Limits,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limits {
    pub position_min_counts: Vec<i32>,
    pub position_max_counts: Vec<i32>,
    pub velocity_counts_s: f64,
    pub acceleration_counts_s2: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    pub complete: bool,
    #[serde(skip_serializing_if = "String::is_empty")]
    pub reason: String,
    pub rows: usize,
    pub samples: usize,
    pub length_s: f64,
    pub encoder_rate_hz: f64,
    pub camera_rate_hz: f64,
    pub missed_messages: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LatencyRecord {
    /// Latency contained in the stamps of the recording, ms.
    pub estimate_ms: f64,
    pub deviation_ms: f64,
}

impl Sidecar {
    pub fn path(recording: &Path) -> PathBuf {
        recording.with_extension("toml")
    }

    pub fn write(&self, recording: &Path) -> Result<(), String> {
        let path = Self::path(recording);
        let text = toml::to_string(self)
            .map_err(|error| format!("cannot write {}: {error}", path.display()))?;
        write(&path, text)
    }
}

/// An interval with a problem. The recording has no row with angles for it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Flag {
    pub t_s: f64,
    pub kind: FlagKind,
    /// Duration, s; 0 for a single reading.
    pub span_s: f64,
    /// Measured values, in the unit of the recording; may be empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FlagKind {
    /// No encoder position for longer than usual; the path of the motors in between is unknown.
    EncoderGap,
    CameraGap,
    /// A frame in a gap of the encoders: the positions of the motors are unknown.
    NoCounts,
    NothingSeen,
    /// Far from the frames before and after, which agree; or an angle that is impossible.
    Outlier,
    /// Arrived after later rows had been written, or with a stamp that does not rise.
    Late,
}

impl FlagKind {
    pub const fn text(self) -> &'static str {
        match self {
            Self::EncoderGap => "encoder gap",
            Self::CameraGap => "camera gap",
            Self::NoCounts => "frame in an encoder gap",
            Self::NothingSeen => "nothing seen",
            Self::Outlier => "outlier",
            Self::Late => "late frame",
        }
    }
}

/// Latencies below this are negligible: the encoders are read every 4 ms.
const SMALL_MS: f64 = 4.0;

pub fn record(latency: &Latency) -> LatencyRecord {
    let round = |seconds: f64| (seconds * 1e5).round() / 1e2;
    LatencyRecord { estimate_ms: round(latency.seconds), deviation_ms: round(latency.deviation_s) }
}

pub fn print(sidecar: &Sidecar, recording: &Path, json: bool) -> Result<(), Failure> {
    if json {
        println!("{}", serde_json::to_string_pretty(sidecar)?);
        return Ok(());
    }
    let Some(outcome) = &sidecar.outcome else { return Ok(()) };
    let Outcome { length_s, rows, encoder_rate_hz, samples, camera_rate_hz, .. } = outcome;
    println!(
        "recorded   {length_s:.1} s: {rows} positions ({encoder_rate_hz:.0} Hz), {samples} with \
         angles ({camera_rate_hz:.1} Hz)"
    );
    println!("latency    {}", latency_text(sidecar.latency.as_ref()));
    let mut flags = BTreeMap::new();
    sidecar.flags.iter().for_each(|flag| *flags.entry(flag.kind).or_insert(0) += 1);
    let flags = flags.iter().map(|(kind, count)| format!("{count} {}", kind.text()));
    let flags = flags.collect::<Vec<_>>().join(", ");
    println!("flags      {}", if flags.is_empty() { "none" } else { &flags });
    if outcome.missed_messages > 0 {
        println!("missed     {} message(s): this program was delayed", outcome.missed_messages);
    }
    let file = recording.display();
    println!("wrote      {file} and {}", Sidecar::path(recording).display());
    if outcome.complete {
        let robot = &sidecar.robot_id;
        println!("next       i2ris calibrate fit {file} --robot-id {robot} --output MODEL.json");
    }
    Ok(())
}

fn latency_text(latency: Option<&LatencyRecord>) -> String {
    let Some(LatencyRecord { estimate_ms, deviation_ms }) = latency else {
        return "of the camera's stamps cannot be estimated from this motion".to_owned();
    };
    let what = if estimate_ms.abs() > SMALL_MS.max(3.0 * deviation_ms) {
        "; `i2ris calibrate fit` corrects it if held-out rows confirm it"
    } else {
        ", negligible"
    };
    format!("{estimate_ms:+.1} +- {deviation_ms:.1} ms in the camera's stamps{what}")
}
