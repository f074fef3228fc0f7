//! YUV4MPEG2, what `ffmpeg -f yuv4mpegpipe` and mplayer write: a line of text for the stream, a
//! line for each picture, then its planes. Only the first plane, brightness, is kept. 8 bit only.
//!
//! A program that knows when it took a picture says so with `XT=` and seconds of the monotonic
//! clock in the line of the picture (`FRAME XT=12.345678901`): words that begin with X are left to
//! applications.

use std::io::Read;

use i2ris::units::Nanos;

use super::raw::{Clock, Size, fill};
use super::stamps::seconds;
use super::{Frame, FrameSource, Shot, SourceError};
use crate::image::Grey;

/// No header line is longer.
const LONGEST_LINE: usize = 512;

/// What the first line says.
#[derive(Debug, Clone, PartialEq)]
struct Header {
    size: Size,
    /// Bytes of the planes behind the first one.
    colour_bytes: usize,
    fps: Option<f64>,
}

/// A YUV4MPEG2 stream.
pub struct Y4m<R> {
    reader: R,
    header: Header,
    clock: Clock,
    number: u64,
}

impl<R: Read + Send> Y4m<R> {
    /// Reads the header.
    ///
    /// # Errors
    ///
    /// The stream does not begin as YUV4MPEG2 does, or has pixels of more than 8 bit.
    pub fn open(mut reader: R, clock: Clock) -> Result<Self, SourceError> {
        let line = read_line(&mut reader)?.ok_or_else(|| SourceError::NotY4m("empty".into()))?;
        let header = parse(&line).map_err(SourceError::NotY4m)?;
        Ok(Self {
            reader,
            header,
            clock,
            number: 0,
        })
    }

    /// Pictures per second as the header states them.
    #[must_use]
    pub fn fps(&self) -> Option<f64> {
        self.header.fps
    }
}

impl<R: Read + Send> FrameSource for Y4m<R> {
    fn next(&mut self) -> Result<Option<Shot>, SourceError> {
        let number = self.number + 1;
        let told = match read_line(&mut self.reader)? {
            None => return Ok(None),
            Some(line) if line == "FRAME" || line.starts_with("FRAME ") => line
                .split(' ')
                .find_map(|word| word.strip_prefix("XT="))
                .and_then(seconds),
            Some(line) => {
                return Err(SourceError::NotY4m(format!(
                    "picture {number} begins with {line:?}, not FRAME"
                )));
            }
        };
        let size = self.header.size;
        let mut data = vec![0; size.bytes() + self.header.colour_bytes];
        let got = fill(&mut self.reader, &mut data)?;
        if got < data.len() {
            return Err(SourceError::Truncated {
                number,
                got,
                expected: data.len(),
                size,
            });
        }
        let by_clock: Nanos = self.clock.stamp(self.number);
        let stamp = told.unwrap_or(by_clock);
        self.number = number;
        data.truncate(size.bytes());
        let picture = Grey::new(size.width, size.height, data);
        Ok(picture.map(|picture| {
            Shot::Frame(Frame {
                stamp,
                name: format!("picture {number}"),
                picture,
            })
        }))
    }
}

/// One line without its end; `None` at the end of the stream.
fn read_line(reader: &mut impl Read) -> Result<Option<String>, SourceError> {
    let mut line = Vec::new();
    let mut byte = [0];
    loop {
        if fill(reader, &mut byte)? == 0 {
            return if line.is_empty() {
                Ok(None)
            } else {
                Err(SourceError::NotY4m("ends within a header line".into()))
            };
        }
        match byte[0] {
            b'\n' => return Ok(Some(String::from_utf8_lossy(&line).into_owned())),
            _ if line.len() >= LONGEST_LINE => {
                return Err(SourceError::NotY4m(
                    "no end of the header line; is this a Y4M stream?".into(),
                ));
            }
            other => line.push(other),
        }
    }
}

fn parse(line: &str) -> Result<Header, String> {
    let mut words = line.split(' ');
    if words.next() != Some("YUV4MPEG2") {
        return Err(
            "does not begin with YUV4MPEG2; for grey bytes without a header give --raw WxH".into(),
        );
    }
    let (mut width, mut height, mut fps, mut colour) = ("", "", None, "420");
    for word in words.filter(|word| !word.is_empty()) {
        match word.split_at_checked(1) {
            Some(("W", rest)) => width = rest,
            Some(("H", rest)) => height = rest,
            Some(("F", rest)) => fps = ratio(rest),
            Some(("C", rest)) => colour = rest,
            // Interlacing, aspect and comments do not change where the bytes are.
            _ => {}
        }
    }
    let size: Size = format!("{width}x{height}").parse()?;
    let half = |n: usize| n.div_ceil(2);
    let colour_bytes = match colour {
        "mono" => 0,
        "420" | "420jpeg" | "420paldv" | "420mpeg2" => 2 * half(size.width) * half(size.height),
        "422" => 2 * half(size.width) * size.height,
        "444" => 2 * size.bytes(),
        other => {
            return Err(format!(
                "colour space {other} is not supported; use 8 bit mono, 420, 422 or 444"
            ));
        }
    };
    Ok(Header {
        size,
        colour_bytes,
        fps,
    })
}

fn ratio(text: &str) -> Option<f64> {
    let (above, below) = text.split_once(':')?;
    let fps = above.parse::<f64>().ok()? / below.parse::<f64>().ok()?;
    (fps.is_finite() && fps > 0.0).then_some(fps)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn stream(header: &str, pictures: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = format!("{header}\n").into_bytes();
        for picture in pictures {
            bytes.extend(b"FRAME\n");
            bytes.extend(picture);
        }
        bytes
    }

    #[test]
    fn keeps_brightness_and_skips_colour() {
        let picture = |value: u8| [vec![value; 16 * 16], vec![200; 2 * 8 * 8]].concat();
        let bytes = stream(
            "YUV4MPEG2 W16 H16 F30:1 Ip C420jpeg",
            &[picture(7), picture(9)],
        );
        let mut source = Y4m::open(&bytes[..], Clock::Rate(30.0)).unwrap();
        assert_eq!(source.fps(), Some(30.0));
        for (value, stamp) in [(7, 0), (9, 33_333_333)] {
            let Some(Shot::Frame(frame)) = source.next().unwrap() else {
                panic!("no frame")
            };
            assert_eq!(frame.picture.data(), vec![value; 256]);
            assert_eq!(frame.stamp, Nanos(stamp));
        }
        assert_eq!(source.next().unwrap(), None);
    }

    #[test]
    fn a_picture_that_says_when_it_was_taken_is_believed() {
        let mut bytes = b"YUV4MPEG2 W16 H16 Cmono\nFRAME Ip XT=12.345678901\n".to_vec();
        bytes.extend([0; 256]);
        let mut source = Y4m::open(&bytes[..], Clock::Rate(30.0)).unwrap();
        let Some(Shot::Frame(frame)) = source.next().unwrap() else {
            panic!("no frame")
        };
        assert_eq!(frame.stamp, Nanos(12_345_678_901));
    }

    #[test]
    fn a_stream_that_ends_within_a_picture_says_so() {
        let mut bytes = stream("YUV4MPEG2 W16 H16 Cmono", &[vec![1; 256], vec![2; 256]]);
        bytes.truncate(bytes.len() - 10);
        let mut source = Y4m::open(&bytes[..], Clock::Rate(30.0)).unwrap();
        assert!(matches!(source.next(), Ok(Some(Shot::Frame(_)))));
        let error = source.next().unwrap_err();
        assert_eq!(
            error.to_string(),
            "picture stream: ends within picture 2, after 246 of 256 bytes; is the size 16x16 right?"
        );
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..600), with_header: bool) {
            let mut all = if with_header { b"YUV4MPEG2 W16 H16 Cmono\n".to_vec() } else { Vec::new() };
            all.extend(bytes);
            if let Ok(mut source) = Y4m::open(&all[..], Clock::Rate(1.0)) {
                while let Ok(Some(_)) = source.next() {}
            }
        }
    }
}
