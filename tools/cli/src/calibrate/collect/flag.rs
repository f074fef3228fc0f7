//! What was wrong with a moment of a recording.

use serde::Serialize;

/// A moment that a person, or a fit, should know of. No row with angles stems from it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Flag {
    /// As in the recording, s.
    pub t_s: f64,
    /// What was wrong.
    pub kind: FlagKind,
    /// How long it lasted, s; 0 for a single reading.
    pub span_s: f64,
    /// What was measured, in the unit of the recording; empty where nothing was.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<f64>,
}

/// What was wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FlagKind {
    /// No encoder position for longer than usual; the way of the motors in between is a guess.
    EncoderGap,
    /// No picture for longer than usual.
    CameraGap,
    /// A picture in a gap of the encoders: nobody knows where the motors were.
    NoCounts,
    /// The camera looked, but saw nothing.
    NothingSeen,
    /// Far from the pictures before and after, which agree; or an angle that no snake has.
    Outlier,
    /// Came when its place in the recording was written already, or with a stamp that does not
    /// rise.
    Late,
}

impl FlagKind {
    /// What people read.
    pub const fn text(self) -> &'static str {
        match self {
            Self::EncoderGap => "encoder gap",
            Self::CameraGap => "camera gap",
            Self::NoCounts => "picture in an encoder gap",
            Self::NothingSeen => "nothing seen",
            Self::Outlier => "outlier",
            Self::Late => "late picture",
        }
    }
}
