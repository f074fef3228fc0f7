//! A frame with its timestamp, and its size.

use std::path::{Path, PathBuf};

use i2ris::units::Nanos;

use crate::image::GreyImage;

/// A frame, or the fault in its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Exposure; of a missing frame, the expected one. Streams: monotonic clock of this machine.
    /// Folders: by their names, list or rate.
    pub stamp: Nanos,
    /// File name, or number in the stream; for messages and overlays.
    pub name: String,
    pub picture: Result<Picture, FrameFault>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    pub image: GreyImage,
    /// The file that it was decoded from, if that was a JPEG.
    pub jpeg: Option<Vec<u8>>,
}

impl Frame {
    /// A frame that did not come as a JPEG.
    pub fn new(stamp: Nanos, name: impl ToString, image: GreyImage) -> Self {
        Self { stamp, name: name.to_string(), picture: Ok(Picture { image, jpeg: None }) }
    }
}

/// Reason for a missing frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, thiserror::Error)]
pub enum FrameFault {
    #[error("file missing")]
    MissingFile,
    #[error("not a whole frame")]
    Undecodable,
    #[error("wrong size")]
    WrongSize,
    #[error("frozen: identical to the previous one")]
    Frozen,
    #[error("identical to a frame of the other view")]
    SameCamera,
    #[error("stamp out of order")]
    OutOfOrder,
    #[error("no frame of the other view at that time")]
    NoPartner,
    #[error("the camera delivers nothing")]
    NoPicture,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageSize {
    pub width: usize,
    pub height: usize,
}

impl ImageSize {
    /// Bytes of one frame with one byte per pixel; at least 1.
    pub fn bytes(self) -> usize {
        self.width * self.height
    }
}

impl std::fmt::Display for ImageSize {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl std::str::FromStr for ImageSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let size = text
            .split_once('x')
            .and_then(|(w, h)| Some(Self { width: w.parse().ok()?, height: h.parse().ok()? }));
        size.filter(|s| (16..=1 << 14).contains(&s.width) && (16..=1 << 14).contains(&s.height))
            .ok_or_else(|| format!("{text:?} is not a size; write columns x rows, e.g. 1280x960"))
    }
}

#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    #[error("{path}: {reason}")]
    File { path: PathBuf, reason: String },
    #[error("frame stream: {0}")]
    Stream(String),
}

impl SourceError {
    pub fn file(path: &Path, reason: impl ToString) -> Self {
        Self::File { path: path.to_owned(), reason: reason.to_string() }
    }
}

impl From<std::io::Error> for SourceError {
    fn from(error: std::io::Error) -> Self {
        Self::Stream(error.to_string())
    }
}
