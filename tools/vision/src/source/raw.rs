//! A stream of grey bytes: frame after frame, without any header.

use std::io::{BufRead, BufReader, Read};

use super::error::SourceError;
use super::frame::SourceItem;
use super::frame_source::{FrameClock, FrameSource, read_frame};
use super::size::ImageSize;

/// A stream of grey bytes.
pub struct RawStream<R> {
    reader: BufReader<R>,
    size: ImageSize,
    clock: FrameClock,
    number: u64,
}

impl<R: Read + Send> RawStream<R> {
    /// Reads frames of `size` from `reader`.
    pub fn new(reader: R, size: ImageSize, clock: FrameClock) -> Self {
        Self { reader: BufReader::new(reader), size, clock, number: 0 }
    }
}

impl<R: Read + Send> FrameSource for RawStream<R> {
    fn next(&mut self) -> Result<Option<SourceItem>, SourceError> {
        if self.reader.fill_buf()?.is_empty() {
            return Ok(None);
        }
        self.number += 1;
        let (number, clock) = (self.number, &mut self.clock);
        read_frame(&mut self.reader, self.size, 0, number, || clock.stamp(number - 1))
    }
}
