//! Where pictures come from.
//!
//! A source hands over one [`Shot`] after the other: a picture with the instant it was taken, or a
//! gap with its cause. Nothing that goes wrong with one picture ends the stream; what ends it is an
//! error that names the place.

mod decode;
mod folder;
mod guard;
mod raw;
mod stamps;
mod y4m;

pub use decode::{DecodeError, decode};
pub use folder::Folder;
pub use guard::{Guard, Twins};
pub use raw::{Clock, Raw, Size};
pub use y4m::Y4m;

use std::path::PathBuf;

use i2ris::units::Nanos;

use crate::image::Grey;

/// A picture and when it was taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// When it was taken. Streams: monotonic clock of this machine. Folders: as its names, its list
    /// or its rate say.
    pub stamp: Nanos,
    /// File name, or number in the stream; for messages and overlays.
    pub name: String,
    /// The picture.
    pub picture: Grey,
}

/// Why there is no picture where one should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Gap {
    /// A number is missing in a numbered folder.
    MissingFile,
    /// The file is not a whole picture.
    Undecodable,
    /// Not the size of the pictures before.
    WrongSize,
    /// Identical to the picture before: the camera is frozen.
    Frozen,
    /// Identical to a picture of the other view: both views show the same camera.
    SameCamera,
    /// Taken before the picture that came before it.
    OutOfOrder,
    /// The other view has no picture of the same time.
    NoPartner,
    /// The camera delivers nothing.
    NoPicture,
}

impl Gap {
    /// Every cause.
    pub const ALL: [Self; 8] = [
        Self::MissingFile,
        Self::Undecodable,
        Self::WrongSize,
        Self::Frozen,
        Self::SameCamera,
        Self::OutOfOrder,
        Self::NoPartner,
        Self::NoPicture,
    ];

    /// What people read.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::MissingFile => "file missing",
            Self::Undecodable => "not a whole picture",
            Self::WrongSize => "wrong size",
            Self::Frozen => "frozen: identical to the one before",
            Self::SameCamera => "identical to a picture of the other view",
            Self::OutOfOrder => "stamp out of order",
            Self::NoPartner => "no picture of the other view at that time",
            Self::NoPicture => "the camera delivers nothing",
        }
    }
}

impl std::fmt::Display for Gap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.text())
    }
}

/// What a source hands over.
#[derive(Debug, Clone, PartialEq)]
pub enum Shot {
    /// A picture.
    Frame(Frame),
    /// None, and why.
    Gap {
        /// When it should have been taken.
        stamp: Nanos,
        /// Which one.
        name: String,
        /// Why.
        cause: Gap,
    },
}

impl Shot {
    /// When it was or should have been taken.
    #[must_use]
    pub fn stamp(&self) -> Nanos {
        match self {
            Self::Frame(frame) => frame.stamp,
            Self::Gap { stamp, .. } => *stamp,
        }
    }
}

/// What ends a stream before its end.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// A file or folder cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The stream cannot be read.
    #[error("picture stream: {0}")]
    Stream(#[from] std::io::Error),
    /// The stream ends within a picture.
    #[error(
        "picture stream: ends within picture {number}, after {got} of {expected} bytes; is the size {size} right?"
    )]
    Truncated {
        /// Number of the picture, from 1.
        number: u64,
        /// Bytes that came.
        got: usize,
        /// Bytes of a whole picture.
        expected: usize,
        /// Size of a picture.
        size: Size,
    },
    /// The stream is not what it should be.
    #[error("picture stream: {0}")]
    NotY4m(String),
    /// The folder holds no pictures.
    #[error("{path}: no PNG or JPEG file in this folder")]
    NoFrames {
        /// The folder.
        path: PathBuf,
    },
    /// A folder whose names carry no numbers and that has no list of stamps.
    #[error(
        "{path}: {file} has no number in its name; number the files, or add frames.csv with columns file,t_s"
    )]
    NoNumber {
        /// The folder.
        path: PathBuf,
        /// The file.
        file: String,
    },
    /// Two files with the same number.
    #[error("{path}: {first} and {second} have the same number")]
    SameNumber {
        /// The folder.
        path: PathBuf,
        /// One file.
        first: String,
        /// The other.
        second: String,
    },
    /// The list of stamps is wrong.
    #[error("{path}: line {line}: {what}")]
    BadList {
        /// The list.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// What is wrong with it.
        what: String,
    },
}

/// Where pictures come from.
pub trait FrameSource: Send {
    /// The next picture or gap; `None` at the end.
    ///
    /// # Errors
    ///
    /// [`SourceError`]: the stream ends here, and not as it should.
    fn next(&mut self) -> Result<Option<Shot>, SourceError>;
}
