//! A stream of grey bytes: picture after picture, without any header.

use std::io::Read;

use i2ris::units::Nanos;

use super::{Frame, FrameSource, Shot, SourceError};
use crate::image::Grey;

/// Columns and rows of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Size {
    /// Bytes of one picture with one byte per pixel; at least 1.
    #[must_use]
    pub fn bytes(self) -> usize {
        self.width * self.height
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl std::str::FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let size = text.split_once('x').and_then(|(w, h)| {
            Some(Self {
                width: w.parse().ok()?,
                height: h.parse().ok()?,
            })
        });
        size.filter(|s| (16..=1 << 14).contains(&s.width) && (16..=1 << 14).contains(&s.height))
            .ok_or_else(|| format!("{text:?} is no size; write columns x rows, such as 1280x960"))
    }
}

/// What gives a picture of a stream its stamp.
pub enum Clock {
    /// The instant that its last byte arrived.
    Arrival(Box<dyn FnMut() -> Nanos + Send>),
    /// Its number and the rate: for recordings that are piped in faster or slower than they were
    /// taken.
    Rate(f64),
}

impl Clock {
    /// The stamp of picture `number`, counted from 0.
    pub(super) fn stamp(&mut self, number: u64) -> Nanos {
        match self {
            Self::Arrival(now) => now(),
            Self::Rate(fps) => Nanos((number as f64 / *fps * 1e9).round() as u64),
        }
    }
}

/// A stream of grey bytes.
pub struct Raw<R> {
    reader: R,
    size: Size,
    clock: Clock,
    number: u64,
}

impl<R: Read + Send> Raw<R> {
    /// Reads pictures of `size` from `reader`.
    pub fn new(reader: R, size: Size, clock: Clock) -> Self {
        Self {
            reader,
            size,
            clock,
            number: 0,
        }
    }
}

impl<R: Read + Send> FrameSource for Raw<R> {
    fn next(&mut self) -> Result<Option<Shot>, SourceError> {
        let mut data = vec![0; self.size.bytes()];
        let got = fill(&mut self.reader, &mut data)?;
        if got == 0 {
            return Ok(None);
        }
        let number = self.number + 1;
        if got < data.len() {
            return Err(SourceError::Truncated {
                number,
                got,
                expected: data.len(),
                size: self.size,
            });
        }
        let stamp = self.clock.stamp(self.number);
        self.number = number;
        let picture = Grey::new(self.size.width, self.size.height, data);
        Ok(picture.map(|picture| {
            Shot::Frame(Frame {
                stamp,
                name: format!("picture {number}"),
                picture,
            })
        }))
    }
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
