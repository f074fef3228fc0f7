//! YUV4MPEG2, what `ffmpeg -f yuv4mpegpipe` and mplayer write: a line of text for the stream, a
//! line for each frame, then its planes. Only the first plane, brightness, is kept. 8 bit only.
//!
//! A program that knows when it took a frame says so with `XT=` and seconds of the monotonic
//! clock in the line of the frame (`FRAME XT=12.345678901`): words that begin with X are left to
//! applications.

use std::io::{BufRead, BufReader, Read};

use super::error::SourceError;
use super::frame::SourceItem;
use super::frame_source::{FrameClock, FrameSource, read_frame};
use super::size::ImageSize;
use super::timestamps::seconds;

/// No header line is longer.
const MAX_LINE: usize = 512;

/// What the first line says.
#[derive(Debug, Clone, PartialEq)]
struct Header {
    size: ImageSize,
    /// Bytes of the planes behind the first one.
    colour_bytes: usize,
    fps: Option<f64>,
}

/// A YUV4MPEG2 stream.
pub struct Y4mStream<R> {
    reader: BufReader<R>,
    header: Header,
    clock: FrameClock,
    number: u64,
}

impl<R: Read + Send> Y4mStream<R> {
    /// Reads the header.
    ///
    /// # Errors
    ///
    /// The stream does not begin as YUV4MPEG2 does, or has pixels of more than 8 bit.
    pub fn open(reader: R, clock: FrameClock) -> Result<Self, SourceError> {
        let mut reader = BufReader::new(reader);
        let line = read_line(&mut reader)?.ok_or_else(|| SourceError::NotY4m("empty".into()))?;
        let header = parse(&line).map_err(SourceError::NotY4m)?;
        Ok(Self { reader, header, clock, number: 0 })
    }

    /// Frames per second as the header states them.
    #[must_use]
    pub fn fps(&self) -> Option<f64> {
        self.header.fps
    }
}

impl<R: Read + Send> FrameSource for Y4mStream<R> {
    fn next(&mut self) -> Result<Option<SourceItem>, SourceError> {
        let number = self.number + 1;
        let reported = match read_line(&mut self.reader)? {
            None => return Ok(None),
            Some(line) if line == "FRAME" || line.starts_with("FRAME ") => {
                line.split(' ').find_map(|word| word.strip_prefix("XT=")).and_then(seconds)
            }
            Some(line) => {
                return Err(SourceError::NotY4m(format!(
                    "frame {number} begins with {line:?}, not FRAME"
                )));
            }
        };
        self.number = number;
        let (size, skipped) = (self.header.size, self.header.colour_bytes);
        let by_clock = || self.clock.stamp(number - 1);
        let stamp = || reported.unwrap_or_else(by_clock);
        read_frame(&mut self.reader, size, skipped, number, stamp)
    }
}

/// One line without its end; `None` at the end of the stream.
fn read_line(reader: &mut impl BufRead) -> Result<Option<String>, SourceError> {
    let mut line = Vec::new();
    reader.take(MAX_LINE as u64 + 1).read_until(b'\n', &mut line)?;
    let error = |text: &str| Err(SourceError::NotY4m(text.into()));
    match line.pop() {
        None => Ok(None),
        Some(b'\n') => Ok(Some(String::from_utf8_lossy(&line).into_owned())),
        Some(_) if line.len() == MAX_LINE => {
            error("no end of the header line; is this a Y4M stream?")
        }
        Some(_) => error("ends within a header line"),
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
    let size: ImageSize = format!("{width}x{height}").parse()?;
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
    Ok(Header { size, colour_bytes, fps })
}

fn ratio(text: &str) -> Option<f64> {
    let (above, below) = text.split_once(':')?;
    let fps = above.parse::<f64>().ok()? / below.parse::<f64>().ok()?;
    (fps.is_finite() && fps > 0.0).then_some(fps)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use i2ris::units::Nanos;

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
        let mut source = Y4mStream::open(&bytes[..], FrameClock::Rate(30.0)).unwrap();
        assert_eq!(source.fps(), Some(30.0));
        for (value, stamp) in [(7, 0), (9, 33_333_333)] {
            let Some(SourceItem::Frame(frame)) = source.next().unwrap() else { panic!("no frame") };
            assert_eq!(frame.image.data(), vec![value; 256]);
            assert_eq!(frame.stamp, Nanos(stamp));
        }
        assert_eq!(source.next().unwrap(), None);
    }

    #[test]
    fn a_frame_that_says_when_it_was_taken_is_believed() {
        let mut bytes = b"YUV4MPEG2 W16 H16 Cmono\nFRAME Ip XT=12.345678901\n".to_vec();
        bytes.extend([0; 256]);
        let mut source = Y4mStream::open(&bytes[..], FrameClock::Rate(30.0)).unwrap();
        let Some(SourceItem::Frame(frame)) = source.next().unwrap() else { panic!("no frame") };
        assert_eq!(frame.stamp, Nanos(12_345_678_901));
    }

    #[test]
    fn a_stream_that_ends_within_a_frame_says_so() {
        let mut bytes = stream("YUV4MPEG2 W16 H16 Cmono", &[vec![1; 256], vec![2; 256]]);
        bytes.truncate(bytes.len() - 10);
        let mut source = Y4mStream::open(&bytes[..], FrameClock::Rate(30.0)).unwrap();
        assert!(matches!(source.next(), Ok(Some(SourceItem::Frame(_)))));
        let error = source.next().unwrap_err();
        assert_eq!(
            error.to_string(),
            "frame stream: ends within frame 2, after 246 of 256 bytes; is the size 16x16 right?"
        );
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
            if let Ok(mut source) = Y4mStream::open(&all[..], FrameClock::Rate(1.0)) {
                while let Ok(Some(_)) = source.next() {}
            }
        }
    }
}
