//! Sources of frames.
//!
//! A source returns one [`SourceItem`] after the other: a frame with its timestamp, or a fault. A
//! faulty frame does not end the source; an error does.

mod decode;
mod error;
mod folder;
mod frame;
mod frame_source;
mod raw;
mod size;
mod stream_check;
mod timestamps;
mod y4m;

pub use decode::{DecodeError, decode};
pub use error::SourceError;
pub use folder::ImageFolder;
pub use frame::{Frame, FrameFault, SourceItem};
pub use frame_source::{FrameClock, FrameSource};
pub use raw::RawStream;
pub use size::ImageSize;
pub use stream_check::{DuplicateCameraMonitor, StreamCheck};
pub use y4m::Y4mStream;
