//! The trait of all sources, and what streams have in common.

use std::io::Read;

use i2ris::units::Nanos;

use super::error::SourceError;
use super::frame::{Frame, SourceItem};
use super::size::ImageSize;
use crate::image::GreyImage;

/// A source of frames.
pub trait FrameSource: Send {
    /// The next frame or gap; `None` at the end.
    ///
    /// # Errors
    ///
    /// [`SourceError`]: the stream ends here, and not as it should.
    fn next(&mut self) -> Result<Option<SourceItem>, SourceError>;
}

/// What gives a frame of a stream its stamp.
pub enum FrameClock {
    /// The instant that its last byte arrived.
    Arrival(Box<dyn FnMut() -> Nanos + Send>),
    /// Its number and the rate: for recordings that are piped in faster or slower than they were
    /// taken.
    Rate(f64),
}

impl FrameClock {
    /// The stamp of frame `number`, counted from 0.
    pub(super) fn stamp(&mut self, number: u64) -> Nanos {
        match self {
            Self::Arrival(now) => now(),
            Self::Rate(fps) => Nanos((number as f64 / *fps * 1e9).round() as u64),
        }
    }
}

/// Reads the first plane of a frame of a stream, followed by `skipped` bytes; `None` at the end of
/// the stream. `number` counts from 1.
pub(super) fn read_frame(
    reader: &mut impl Read,
    size: ImageSize,
    skipped: usize,
    number: u64,
    stamp: impl FnOnce() -> Nanos,
) -> Result<Option<SourceItem>, SourceError> {
    let mut data = vec![0; size.bytes() + skipped];
    let (got, expected) = (fill(reader, &mut data)?, data.len());
    if got < expected {
        return Err(SourceError::Truncated { number, got, expected, size });
    }
    data.truncate(size.bytes());
    let (stamp, name) = (stamp(), format!("frame {number}"));
    let image = GreyImage::new(size.width, size.height, data);
    Ok(image.map(|image| SourceItem::Frame(Frame { stamp, name, image })))
}

/// Fills `data`; fewer bytes mean the end of the stream.
pub(super) fn fill(reader: &mut impl Read, data: &mut [u8]) -> Result<usize, std::io::Error> {
    let mut got = 0;
    while got < data.len() {
        match reader.read(&mut data[got..]) {
            Ok(0) => break,
            Ok(count) => got += count,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(got)
}
