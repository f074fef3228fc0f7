//! Flagged moments of a recording.

use serde::Serialize;

/// A moment with a problem. The recording has no row with angles for it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Flag {
    /// As in the recording, s.
    pub t_s: f64,
    /// The problem.
    pub kind: FlagKind,
    /// How long it lasted, s; 0 for a single reading.
    pub span_s: f64,
    /// What was measured, in the unit of the recording; empty where nothing was.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<f64>,
}

/// The problem.
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
    /// Arrived after later rows had been written, or with a stamp that does not
    /// rise.
    Late,
}

impl FlagKind {
    /// The name in printed text.
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
