//! Sources of frames.
//!
//! A source returns one [`Frame`] after the other: a picture with its timestamp, or a fault. A
//! faulty frame does not end the source; an error does.

mod folder;
mod mjpeg;
mod stream;

use std::path::{Path, PathBuf};

use i2ris::units::Nanos;

use crate::image::GreyImage;

pub use folder::ImageFolder;
pub use mjpeg::MjpegStream;
pub use stream::{FrameClock, FrameStream};

pub trait FrameSource: Send {
    /// The next frame; `None` at the end.
    fn next(&mut self) -> Result<Option<Frame>, SourceError>;
}

/// A frame, or the fault in its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Exposure; of a missing frame, the expected one. Streams: monotonic clock. Folders: names,
    /// rate.
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
    pub fn new(stamp: Nanos, name: impl ToString, image: GreyImage) -> Self {
        Self { stamp, name: name.to_string(), picture: Ok(Picture { image, jpeg: None }) }
    }
}

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
