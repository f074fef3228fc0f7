//! Metadata of a recording, in a TOML file next to it.
//!
//! Written when the recording begins, so that an interrupted one also has it, and again at the end.

use std::path::{Path, PathBuf};

use i2ris::robot::DriveFingerprint;
use serde::Serialize;

use i2ris_report::files::write;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sidecar {
    /// Always `i2ris-recording`.
    pub format: &'static str,
    /// Version of this file's layout.
    pub schema_version: u32,
    /// Name of the recording, without folders.
    pub recording: String,
    /// Robot id of the controller's configuration.
    pub robot_id: String,
    pub software: String,
    pub controller: String,
    /// Identity of the model that the controller had loaded; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_id: Option<String>,
    /// When `t_s` was 0, on the wall clock, seconds since 1970.
    pub started_unix_s: u64,
    pub protocol: ProtocolRecord,
    /// The outcome; absent while recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outcome: Option<Outcome>,
    /// Latency of the camera's stamps; absent if it cannot be estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency: Option<LatencyRecord>,
    /// The drive settings; empty if the controller does not report them.
    pub drives: Vec<DriveFingerprint>,
    /// Intervals with problems.
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

/// The controller's limits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limits {
    pub position_min_counts: Vec<i32>,
    pub position_max_counts: Vec<i32>,
    pub velocity_counts_s: f64,
    pub acceleration_counts_s2: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// The protocol ran to its end.
    pub complete: bool,
    /// Reason if incomplete; empty otherwise.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub reason: String,
    pub rows: usize,
    /// Rows with angles.
    pub samples: usize,
    /// Time from the first row to the last, s.
    pub length_s: f64,
    /// Rows without angles, per second.
    pub encoder_rate_hz: f64,
    /// Rows with angles, per second.
    pub camera_rate_hz: f64,
    /// Messages that this program was too slow to read.
    pub missed_messages: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LatencyRecord {
    /// Latency contained in the stamps of the recording, ms.
    pub estimate_ms: f64,
    /// Standard deviation of the estimate, ms.
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
    /// Time as in the recording, s.
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
    /// No frame for longer than usual.
    CameraGap,
    /// A frame in a gap of the encoders: the positions of the motors are unknown.
    NoCounts,
    /// The camera looked, but saw nothing.
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
