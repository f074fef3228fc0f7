//! Sources of frames.
//!
//! A source returns one [`Frame`] after the other: a picture with its timestamp, or a fault. A
//! faulty frame does not end the source; an error does.

mod decode;
mod folder;
mod frame;
mod mjpeg;
mod stream;
mod stream_check;
mod timestamps;

pub use decode::decode;
pub use folder::ImageFolder;
pub use frame::{Frame, FrameFault, ImageSize, Picture, SourceError};
pub use mjpeg::MjpegStream;
pub use stream::{FrameClock, FrameSource, FrameStream};
pub use stream_check::{DuplicateCameraMonitor, StreamCheck};
