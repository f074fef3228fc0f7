//! Streams of JPEG files, one after the other, as cameras compress them themselves:
//! `ffmpeg -f v4l2 -input_format mjpeg -i /dev/video0 -c copy -f mjpeg -`.

use std::io::{BufReader, Read};

use super::decode::decode;
use super::frame::{Frame, FrameFault, SourceError, SourceItem};
use super::stream::{FrameClock, FrameSource};

/// A file that is longer is none of a camera.
const MAX_LENGTH: usize = 64 << 20;

/// A stream of JPEG files.
pub struct MjpegStream<R> {
    reader: BufReader<R>,
    clock: FrameClock,
    number: u64,
}

impl<R: Read + Send> MjpegStream<R> {
    pub fn new(reader: R, clock: FrameClock) -> Self {
        Self { reader: BufReader::new(reader), clock, number: 0 }
    }

    fn take(&mut self, file: &mut Vec<u8>, count: usize) -> Result<(), SourceError> {
        let (number, before) = (self.number + 1, file.len());
        if before + count > MAX_LENGTH {
            let reason = format!("picture {number} has no end; is this a stream of JPEG files?");
            return Err(SourceError::Stream(reason));
        }
        file.resize(before + count, 0);
        self.reader
            .read_exact(&mut file[before..])
            .map_err(|_| SourceError::Stream(format!("ends within picture {number}")))
    }

    /// The next file; `None` at the end of the stream.
    fn file(&mut self) -> Result<Option<Vec<u8>>, SourceError> {
        let mut file = vec![0];
        if self.reader.read(&mut file)? == 0 {
            return Ok(None);
        }
        self.take(&mut file, 1)?;
        if file != [0xFF, 0xD8] {
            let reason = format!("picture {} does not begin as a JPEG does", self.number + 1);
            return Err(SourceError::Stream(reason));
        }
        self.take(&mut file, 2)?;
        loop {
            let marker = file[file.len() - 1];
            if marker == 0xD9 {
                return Ok(Some(file));
            }
            self.take(&mut file, 2)?;
            let length = [file[file.len() - 2], file[file.len() - 1]];
            self.take(&mut file, usize::from(u16::from_be_bytes(length)).saturating_sub(2))?;
            // The next marker; behind the begin of a scan, at its end: FF within it is followed by
            // 0 or is a restart.
            self.take(&mut file, 2)?;
            let is_data = |end: &[u8]| !matches!(end, [.., 0xFF, 1..=0xCF | 0xD8..=0xFE]);
            while marker == 0xDA && is_data(&file) {
                self.take(&mut file, 1)?;
            }
        }
    }
}

impl<R: Read + Send> FrameSource for MjpegStream<R> {
    fn next(&mut self) -> Result<Option<SourceItem>, SourceError> {
        let Some(jpeg) = self.file()? else { return Ok(None) };
        let stamp = self.clock.stamp(self.number);
        self.number += 1;
        let name = format!("frame {}", self.number);
        Ok(Some(match decode(&jpeg) {
            Ok(image) => SourceItem::Frame(Frame { stamp, name, image, jpeg: Some(jpeg) }),
            Err(_) => SourceItem::Missing { stamp, name, cause: FrameFault::Undecodable },
        }))
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
    fn pictures_are_parted_where_they_end_and_keep_their_bytes() {
        let files = [jpeg(0), jpeg(100), jpeg(200)];
        let all = files.concat();
        let mut stream = MjpegStream::new(&all[..], FrameClock::Rate(10.0));
        for (number, file) in files.iter().enumerate() {
            let Some(SourceItem::Frame(frame)) = stream.next().unwrap() else { panic!("no frame") };
            assert_eq!(frame.jpeg.as_ref(), Some(file));
            assert_eq!(frame.stamp, Nanos(100_000_000 * number as u64));
        }
        assert_eq!(stream.next().unwrap(), None);
    }

    #[test]
    fn what_is_cut_off_or_no_picture_ends_with_a_sentence() {
        let file = jpeg(3);
        for length in 1..file.len() {
            let mut stream = MjpegStream::new(&file[..length], FrameClock::Rate(10.0));
            let error = stream.next().unwrap_err().to_string();
            assert!(error.contains("ends within picture 1"), "{length}: {error}");
        }
        let mut stream = MjpegStream::new(&b"YUV4MPEG2"[..], FrameClock::Rate(10.0));
        assert!(stream.next().unwrap_err().to_string().contains("does not begin as a JPEG"));
    }
}
