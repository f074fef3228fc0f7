//! Streams of frames: YUV4MPEG2.
//!
//! It is what `ffmpeg -f yuv4mpegpipe` and mplayer write: a line of text for the stream, a
//! line for each frame, then its planes. Only the first plane, brightness, is kept. 8 bit only. A
//! program that knows the exposure writes `XT=` and seconds of the monotonic clock into the line of
//! the frame (`FRAME XT=12.345678901`): words that begin with X are reserved for applications.

use std::io::{BufRead, BufReader, Read};

use i2ris::units::Nanos;

use super::folder::seconds;
use super::{Frame, FrameSource, SourceError};
use crate::image::GreyImage;

const FRAME: &str = "FRAME";
/// Buffer of a stream, bytes: large enough for large reads.
pub(super) const BUFFER: usize = 1 << 18;
/// Maximum length of a header line, bytes.
const MAX_LINE: usize = 512;

pub enum FrameClock {
    /// The instant that its last byte arrived.
    Arrival(Box<dyn FnMut() -> Nanos + Send>),
    /// Its number and the rate: for recordings piped in at a different rate.
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

#[derive(Debug, Clone, Copy)]
struct Format {
    width: usize,
    height: usize,
    /// Bytes of the planes after the first one, which has one per pixel.
    colour_bytes: usize,
}

impl Format {
    fn bytes(&self) -> usize {
        self.width * self.height + self.colour_bytes
    }
}

pub struct FrameStream<R> {
    reader: BufReader<R>,
    format: Format,
    clock: FrameClock,
    number: u64,
}

impl<R: Read + Send> FrameStream<R> {
    pub fn y4m(reader: R, clock: FrameClock) -> Result<Self, SourceError> {
        let mut reader = BufReader::with_capacity(BUFFER, reader);
        let line = read_line(&mut reader)?.ok_or_else(|| SourceError::Stream("empty".into()))?;
        let format = parse(&line).map_err(SourceError::Stream)?;
        Ok(Self { reader, format, clock, number: 0 })
    }

    /// The words of the line that begins the next frame; `None` at the end of the stream. Bytes
    /// between two frames, and the rest of an incomplete one, are skipped.
    fn find(&mut self) -> Result<Option<String>, SourceError> {
        let mut last = [0; FRAME.len() + 1];
        let longest = 4 * self.format.bytes();
        for byte in self.reader.by_ref().bytes().take(longest) {
            last.rotate_left(1);
            last[FRAME.len()] = byte?;
            match last.strip_prefix(FRAME.as_bytes()) {
                Some(b"\n") => return Ok(Some(String::new())),
                Some(b" ") => return read_line(&mut self.reader),
                _ => {}
            }
        }
        let number = self.number + 1;
        match self.reader.fill_buf()? {
            [] => Ok(None),
            _ => Err(SourceError::Stream(format!("frame {number} does not begin with {FRAME}"))),
        }
    }
}

impl<R: Read + Send> FrameSource for FrameStream<R> {
    fn next(&mut self) -> Result<Option<Frame>, SourceError> {
        let Some(words) = self.find()? else { return Ok(None) };
        let reported = words.split(' ').find_map(|word| word.strip_prefix("XT=")).and_then(seconds);
        self.number += 1;
        let (number, Format { width, height, .. }) = (self.number, self.format);
        let expected = self.format.bytes();
        let mut data = Vec::with_capacity(expected);
        let got = self.reader.by_ref().take(expected as u64).read_to_end(&mut data)?;
        if got < expected {
            return Err(SourceError::Stream(format!(
                "ends within frame {number}, after {got} of {expected} bytes; is the size \
                 {width}x{height} right?"
            )));
        }
        data.truncate(width * height);
        let stamp = reported.unwrap_or_else(|| self.clock.stamp(number - 1));
        let name = format!("frame {number}");
        let image = GreyImage::new(width, height, data);
        Ok(image.map(|image| Frame::new(stamp, name, image)))
    }
}

/// One line without its end; `None` at the end of the stream.
fn read_line(reader: &mut impl BufRead) -> Result<Option<String>, SourceError> {
    let mut line = Vec::new();
    reader.take(MAX_LINE as u64 + 1).read_until(b'\n', &mut line)?;
    let error = |text: &str| Err(SourceError::Stream(text.into()));
    match line.pop() {
        None => Ok(None),
        Some(b'\n') => Ok(Some(String::from_utf8_lossy(&line).into_owned())),
        Some(_) if line.len() == MAX_LINE => {
            error("no end of the header line; is this a Y4M stream?")
        }
        Some(_) => error("ends within a header line"),
    }
}

fn parse(line: &str) -> Result<Format, String> {
    let mut words = line.split(' ');
    if words.next() != Some("YUV4MPEG2") {
        return Err("does not begin with YUV4MPEG2; for JPEG files give --format mjpeg".into());
    }
    let (mut width, mut height, mut colour) = ("", "", "420");
    for word in words.filter(|word| !word.is_empty()) {
        match word.split_at_checked(1) {
            Some(("W", rest)) => width = rest,
            Some(("H", rest)) => height = rest,
            Some(("C", rest)) => colour = rest,
            // Half of the lines have a different exposure: the snake has moved in between.
            Some(("I", fields @ ("t" | "b" | "m"))) => {
                return Err(format!(
                    "interlaced pictures (I{fields}): every picture has two exposures; deinterlace \
                     them with `ffmpeg -i FILE -vf yadif -f yuv4mpegpipe -`"
                ));
            }
            // Rate, aspect and comments do not change the layout of the bytes.
            _ => {}
        }
    }
    let side = |text: &str| text.parse().ok().filter(|side: &usize| (16..=1 << 14).contains(side));
    let (Some(width), Some(height)) = (side(width), side(height)) else {
        let size = format!("{width}x{height}");
        return Err(format!("{size:?} is not a size; write columns x rows, e.g. 1280x960"));
    };
    let colour_bytes = match colour {
        "mono" => 0,
        "420" | "420jpeg" | "420paldv" | "420mpeg2" => 2 * width.div_ceil(2) * height.div_ceil(2),
        "422" => 2 * width.div_ceil(2) * height,
        "444" => 2 * width * height,
        other => {
            return Err(format!(
                "colour space {other} is not supported; use 8 bit mono, 420, 422 or 444"
            ));
        }
    };
    Ok(Format { width, height, colour_bytes })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn stream(header: &str, images: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = format!("{header}\n").into_bytes();
        for image in images {
            bytes.extend(b"FRAME\n");
            bytes.extend(image);
        }
        bytes
    }

    #[test]
    fn keeps_brightness_and_skips_colour() {
        let image = |value: u8| [vec![value; 16 * 16], vec![200; 2 * 8 * 8]].concat();
        let bytes = stream("YUV4MPEG2 W16 H16 F30:1 Ip C420jpeg", &[image(7), image(9)]);
        let mut source = FrameStream::y4m(&bytes[..], FrameClock::Rate(30.0)).unwrap();
        for (value, stamp) in [(7, 0), (9, 33_333_333)] {
            let frame = source.next().unwrap().unwrap();
            assert_eq!(frame.picture.unwrap().image.data(), vec![value; 256]);
            assert_eq!(frame.stamp, Nanos(stamp));
        }
        assert_eq!(source.next().unwrap(), None);
    }

    #[test]
    fn exposure_stamps_are_kept_and_bytes_between_frames_skipped() {
        let line = b"FRAME Ip XT=12.345678901\n".to_vec();
        let image = |value| [line.clone(), vec![value; 256]].concat();
        let header = b"YUV4MPEG2 W16 H16 Cmono\n".to_vec();
        let bytes = [header, image(1), vec![7; 300], image(2), b"\n\n".to_vec(), image(3)].concat();
        let mut source = FrameStream::y4m(&bytes[..], FrameClock::Rate(30.0)).unwrap();
        for value in 1..=3 {
            let frame = source.next().unwrap().unwrap();
            let last = frame.picture.unwrap().image.data()[255];
            assert_eq!((last, frame.stamp), (value, Nanos(12_345_678_901)));
        }
        assert_eq!(source.next().unwrap(), None);
    }

    /// Two exposures in one picture cause 0.3 deg of error instead of 0.02.
    #[test]
    fn interlaced_pictures_are_refused_with_a_remedy() {
        for (word, is_taken) in [("Ip", true), ("I?", true), ("It", false), ("Ib", false)] {
            let bytes = stream(&format!("YUV4MPEG2 W16 H16 {word} Cmono"), &[vec![1; 256]]);
            let source = FrameStream::y4m(&bytes[..], FrameClock::Rate(30.0));
            let error = source.map_err(|error| error.to_string()).err();
            assert_eq!(error.is_none(), is_taken, "{word}");
            assert!(error.is_none_or(|error| error.contains("yadif")));
        }
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_do_not_panic(
            bytes in proptest::collection::vec(any::<u8>(), 0..600),
            with_header: bool,
        ) {
            let header: &[u8] = if with_header { b"YUV4MPEG2 W16 H16 Cmono\n" } else { &[] };
            let mut all = header.to_vec();
            all.extend(bytes);
            if let Ok(mut source) = FrameStream::y4m(&all[..], FrameClock::Rate(1.0)) {
                while let Ok(Some(_)) = source.next() {}
            }
        }
    }
}
