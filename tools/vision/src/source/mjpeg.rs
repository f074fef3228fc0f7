//! Streams of JPEG files, one after the other, as cameras compress them themselves:
//! `ffmpeg -f v4l2 -input_format mjpeg -i /dev/video0 -c copy -f mjpeg -`.

use std::collections::VecDeque;
use std::io::{BufReader, Read};

use super::stream::{BUFFER, FrameClock};
use super::{Frame, FrameFault, FrameSource, Picture, SourceError};
use crate::image::decode;

/// Maximum length of a file, bytes: a longer one is not from a camera.
const MAX_LENGTH: usize = 64 << 20;
/// The start of a picture, and of the marker after it.
const START: [u8; 3] = [0xFF, 0xD8, 0xFF];

/// A stream of JPEG files. Bytes between them are skipped: encoders pad, and repeat the end marker.
pub struct MjpegStream<R> {
    reader: BufReader<R>,
    /// Read, but not yet used: from the first start after a damaged picture on.
    pending: VecDeque<u8>,
    clock: FrameClock,
    number: u64,
    has_picture: bool,
}

impl<R: Read + Send> MjpegStream<R> {
    pub fn new(reader: R, clock: FrameClock) -> Self {
        let (reader, pending) = (BufReader::with_capacity(BUFFER, reader), VecDeque::new());
        Self { reader, pending, clock, number: 0, has_picture: false }
    }

    /// The next byte; `None` at the end of the stream.
    fn byte(&mut self) -> Result<Option<u8>, SourceError> {
        if let Some(byte) = self.pending.pop_front() {
            return Ok(Some(byte));
        }
        let mut byte = [0];
        Ok((self.reader.read(&mut byte)? == 1).then_some(byte[0]))
    }

    fn take(&mut self, file: &mut Vec<u8>, count: usize) -> Result<(), SourceError> {
        let number = self.number + 1;
        if file.len() + count > MAX_LENGTH {
            let reason = format!("picture {number} has no end; is this a stream of JPEG files?");
            return Err(SourceError::Stream(reason));
        }
        for _ in 0..count {
            let ends = || SourceError::Stream(format!("ends within picture {number}"));
            file.push(self.byte()?.ok_or_else(ends)?);
        }
        Ok(())
    }

    /// Skips to the next start, and takes it; `false` at the end of the stream.
    fn find_start(&mut self) -> Result<bool, SourceError> {
        let (mut last, mut skipped) = ([0; START.len()], 0);
        while last != START {
            let Some(byte) = self.byte()? else {
                let is_other = skipped > 0 && !self.has_picture;
                let reason = "no picture in it; is this a stream of JPEG files?";
                return if is_other { Err(SourceError::Stream(reason.into())) } else { Ok(false) };
            };
            last = [last[1], last[2], byte];
            skipped += 1;
            if skipped > MAX_LENGTH {
                let reason = format!("no picture in {skipped} bytes; is this a stream of JPEGs?");
                return Err(SourceError::Stream(reason));
            }
        }
        self.has_picture = true;
        Ok(true)
    }

    /// The next file, if it is not damaged; `None` at the end of the stream.
    fn file(&mut self) -> Result<Option<Option<Vec<u8>>>, SourceError> {
        if !self.find_start()? {
            return Ok(None);
        }
        let mut file = START.to_vec();
        let outcome = self.rest(&mut file);
        // A truncated picture is followed by the next one, which was read as part of it.
        let next = file.windows(START.len()).skip(1).position(|bytes| bytes == START);
        match (outcome, next) {
            (Ok(true), None) => Ok(Some(Some(file))),
            (Err(error), None) => Err(error),
            (_, next) => {
                // The last bytes may be an incomplete start.
                let open = (1..START.len()).rev().find(|&n| file.ends_with(&START[..n]));
                let begin = next.map_or(file.len() - open.unwrap_or(0), |next| next + 1);
                for byte in file.drain(begin..).rev() {
                    self.pending.push_front(byte);
                }
                Ok(Some(None))
            }
        }
    }

    /// Reads the rest of a file, after its start; returns whether it is well-formed.
    fn rest(&mut self, file: &mut Vec<u8>) -> Result<bool, SourceError> {
        self.take(file, 1)?;
        loop {
            let [.., fill, marker] = file[..] else { return Ok(false) };
            match (fill, marker) {
                (0xFF, 0xD9) => return Ok(true),
                // A start within a picture, or a missing marker.
                (0xFF, 0xD8) | (..0xFF, _) => return Ok(false),
                _ => {}
            }
            self.take(file, 2)?;
            let length = [file[file.len() - 2], file[file.len() - 1]];
            self.take(file, usize::from(u16::from_be_bytes(length)).saturating_sub(2))?;
            // The next marker; in a scan, at its end: FF in it precedes 0 or is a restart.
            self.take(file, 2)?;
            let is_data = |end: &[u8]| !matches!(end, [.., 0xFF, 1..=0xCF | 0xD8..=0xFE]);
            while marker == 0xDA && is_data(file) {
                self.take(file, 1)?;
            }
        }
    }
}

impl<R: Read + Send> FrameSource for MjpegStream<R> {
    fn next(&mut self) -> Result<Option<Frame>, SourceError> {
        let Some(file) = self.file()? else { return Ok(None) };
        let stamp = self.clock.stamp(self.number);
        self.number += 1;
        let name = format!("frame {}", self.number);
        let picture = file.and_then(|jpeg| {
            let image = decode(&jpeg).ok()?;
            Some(Picture { image, jpeg: Some(jpeg) })
        });
        Ok(Some(Frame { stamp, name, picture: picture.ok_or(FrameFault::Undecodable) }))
    }
}

#[cfg(test)]
mod tests {
    use i2ris::units::Nanos;

    use super::*;

    fn jpeg(value: u8) -> Vec<u8> {
        let mut file = Vec::new();
        let noise = (0..32 * 32).map(|at: u32| (at * 7919 % 251) as u8 ^ value);
        let pixels: Vec<u8> = noise.collect();
        let encoder = jpeg_encoder::Encoder::new(&mut file, 95);
        encoder.encode(&pixels, 32, 32, jpeg_encoder::ColorType::Luma).unwrap();
        file
    }

    #[test]
    fn pictures_are_split_at_their_ends_and_keep_their_bytes() {
        let files = [jpeg(0), jpeg(100), jpeg(200)];
        let all = files.concat();
        let mut stream = MjpegStream::new(&all[..], FrameClock::Rate(10.0));
        for (number, file) in files.iter().enumerate() {
            let frame = stream.next().unwrap().unwrap();
            assert_eq!(frame.picture.unwrap().jpeg.as_ref(), Some(file));
            assert_eq!(frame.stamp, Nanos(100_000_000 * number as u64));
        }
        assert_eq!(stream.next().unwrap(), None);
    }

    #[test]
    fn truncated_or_foreign_data_end_with_a_message() {
        let file = jpeg(3);
        for length in START.len()..file.len() {
            let mut stream = MjpegStream::new(&file[..length], FrameClock::Rate(10.0));
            let error = stream.next().unwrap_err().to_string();
            assert!(error.contains("ends within picture 1"), "{length}: {error}");
        }
        let mut stream = MjpegStream::new(&b"YUV4MPEG2"[..], FrameClock::Rate(10.0));
        assert!(stream.next().unwrap_err().to_string().contains("is this a stream of JPEG"));
    }

    /// Padding as written by encoders, a repeated end marker, and a picture with a missing part.
    #[test]
    fn padding_is_skipped_and_a_damaged_picture_is_one_gap() {
        let [a, b, c] = [jpeg(0), jpeg(100), jpeg(200)];
        for between in [&[0; 3][..], b"\n", &[0xFF, 0xD9], &[0xFF, 0, 0xFF]] {
            let all = [&a, between, &b, between, &c, between].concat();
            let mut stream = MjpegStream::new(&all[..], FrameClock::Rate(10.0));
            for file in [&a, &b, &c] {
                let picture = stream.next().unwrap().unwrap().picture.unwrap();
                assert_eq!(picture.jpeg.as_ref(), Some(file), "{between:?}");
            }
            assert_eq!(stream.next().unwrap(), None);
        }
        for length in START.len()..b.len() {
            let all = [&a, &b[..length], &c].concat();
            let mut stream = MjpegStream::new(&all[..], FrameClock::Rate(10.0));
            let mut found = Vec::new();
            while let Some(frame) = stream.next().unwrap() {
                let is_one = |picture: Picture| [&a, &c].contains(&&picture.jpeg.unwrap());
                found.push(frame.picture.is_ok_and(is_one));
            }
            assert_eq!(found, [true, false, true], "{length}");
        }
    }
}
