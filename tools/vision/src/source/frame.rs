//! A frame with its timestamp, or the fault in its place.

use i2ris::units::Nanos;

use crate::image::GreyImage;

/// A frame and when it was taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// When it was taken. Streams: monotonic clock of this machine. Folders: as its names, its list
    /// or its rate say.
    pub stamp: Nanos,
    /// File name, or number in the stream; for messages and overlays.
    pub name: String,
    /// The frame.
    pub image: GreyImage,
}

/// Why there is no frame where one should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum FrameFault {
    /// A number is missing in a numbered folder.
    MissingFile,
    /// The file is not a whole frame.
    Undecodable,
    /// Not the size of the frames before.
    WrongSize,
    /// Identical to the frame before: the camera is frozen.
    Frozen,
    /// Identical to a frame of the other view: both views show the same camera.
    SameCamera,
    /// Taken before the frame that came before it.
    OutOfOrder,
    /// The other view has no frame of the same time.
    NoPartner,
    /// The camera delivers nothing.
    NoPicture,
}

impl FrameFault {
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

    /// Its text in messages.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::MissingFile => "file missing",
            Self::Undecodable => "not a whole frame",
            Self::WrongSize => "wrong size",
            Self::Frozen => "frozen: identical to the one before",
            Self::SameCamera => "identical to a frame of the other view",
            Self::OutOfOrder => "stamp out of order",
            Self::NoPartner => "no frame of the other view at that time",
            Self::NoPicture => "the camera delivers nothing",
        }
    }
}

impl std::fmt::Display for FrameFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.text())
    }
}

/// What a source hands over.
#[derive(Debug, Clone, PartialEq)]
pub enum SourceItem {
    /// A frame.
    Frame(Frame),
    /// None, and why.
    Missing {
        /// When it should have been taken.
        stamp: Nanos,
        /// Which one.
        name: String,
        /// Why.
        cause: FrameFault,
    },
}

impl SourceItem {
    /// When it was or should have been taken.
    #[must_use]
    pub fn stamp(&self) -> Nanos {
        match self {
            Self::Frame(frame) => frame.stamp,
            Self::Missing { stamp, .. } => *stamp,
        }
    }
}
