//! Raw bytes of a device with their times, as a file; played, the same bytes through a pipe.
//!
//! One line of JSON with the [`Description`], then frames: nanoseconds since the first (u64),
//! length (u16), bytes, little-endian. A report of hidraw is one frame: it does not mark its end.

use std::io::{self, ErrorKind, Read, Write};

use i2ris::units::Nanos;

use crate::state::Description;

/// Maximum frame, bytes: the amount of one read.
pub const MAX_FRAME: usize = 4096;
/// A description has some hundred keys at most.
const MAX_HEAD: usize = 64 * 1024;
const HEAD_OF_FRAME: usize = 10;

/// Time since the first frame, and bytes.
pub type Frame = (Nanos, Vec<u8>);

/// Error when reading a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    #[error(
        "it does not begin with the description of a device; `i2ris teleop input record` creates \
         such files"
    )]
    Head,
    #[error("a frame of {0} bytes: longer than {MAX_FRAME}, so the file is damaged")]
    Frame(usize),
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Writes the head of a recording.
pub fn write_head(output: &mut impl Write, description: &Description) -> io::Result<()> {
    serde_json::to_writer(&mut *output, description)?;
    output.write_all(b"\n")
}

/// Writes a frame of at most [`MAX_FRAME`] bytes.
pub fn write_frame(output: &mut impl Write, since_start: Nanos, bytes: &[u8]) -> io::Result<()> {
    let length = u16::try_from(bytes.len()).map_err(|_| ErrorKind::InvalidInput)?;
    let frame = [&since_start.0.to_le_bytes()[..], &length.to_le_bytes(), bytes].concat();
    // In one write: the reader of a pipe gets complete frames.
    output.write_all(&frame)
}

/// Parses a recording that arrives in pieces of any size.
#[derive(Debug, Default)]
pub struct Parser {
    bytes: Vec<u8>,
    has_head: bool,
}

impl Parser {
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    /// The description, once it has arrived.
    pub fn head(&mut self) -> Result<Option<Description>, RecordingError> {
        let Some(end) = self.bytes.iter().position(|byte| *byte == b'\n') else {
            return if self.bytes.len() > MAX_HEAD { Err(RecordingError::Head) } else { Ok(None) };
        };
        let head = serde_json::from_slice(&self.bytes[..end]).map_err(|_| RecordingError::Head)?;
        self.bytes.drain(..=end);
        self.has_head = true;
        Ok(Some(head))
    }

    /// The next complete frame: its time and bytes.
    pub fn frame(&mut self) -> Result<Option<Frame>, RecordingError> {
        let frame = self.bytes.split_first_chunk::<HEAD_OF_FRAME>().filter(|_| self.has_head);
        let Some((&[time @ .., low, high], rest)) = frame else {
            return Ok(None);
        };
        let length = usize::from(u16::from_le_bytes([low, high]));
        if length > MAX_FRAME {
            return Err(RecordingError::Frame(length));
        }
        let Some(bytes) = rest.get(..length).map(<[u8]>::to_vec) else {
            return Ok(None);
        };
        self.bytes.drain(..HEAD_OF_FRAME + length);
        Ok(Some((Nanos(u64::from_le_bytes(time)), bytes)))
    }
}

/// Reads a whole recording: the description, and the frames.
pub fn read(mut input: impl Read) -> Result<(Description, Vec<Frame>), RecordingError> {
    let (mut parser, mut bytes) = (Parser::default(), Vec::new());
    input.read_to_end(&mut bytes)?;
    parser.push(&bytes);
    let head = parser.head()?.ok_or(RecordingError::Head)?;
    let frames = std::iter::from_fn(|| parser.frame().transpose());
    Ok((head, frames.collect::<Result<_, _>>()?))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::identity::Identity;
    use crate::space_mouse;

    fn description() -> Description {
        space_mouse::description(Identity::new(1, 2, "Mouse\nof space"))
    }

    #[test]
    fn anything_but_a_recording_is_refused() {
        assert!(matches!(read(&b"t_s,pitch\n"[..]), Err(RecordingError::Head)));
        let mut bytes = Vec::new();
        write_head(&mut bytes, &description()).unwrap();
        bytes.extend([0; 8]);
        bytes.extend([0xff, 0xff]);
        assert!(matches!(read(&bytes[..]), Err(RecordingError::Frame(65535))));
    }

    proptest! {
        #[test]
        fn recording_is_read_back_unchanged_in_any_pieces(
            frames in prop::collection::vec(
                (any::<u64>(), prop::collection::vec(any::<u8>(), 0..40)),
                0..8,
            ),
            cut in 1..50_usize,
        ) {
            let frames: Vec<_> = frames.into_iter().map(|(at, bytes)| (Nanos(at), bytes)).collect();
            let mut bytes = Vec::new();
            write_head(&mut bytes, &description()).unwrap();
            for (at, frame) in &frames {
                write_frame(&mut bytes, *at, frame).unwrap();
            }
            prop_assert_eq!(read(&bytes[..]).unwrap(), (description(), frames.clone()));
            let (mut parser, mut head, mut found) = (Parser::default(), None, Vec::new());
            for piece in bytes.chunks(cut) {
                parser.push(piece);
                if head.is_none() {
                    head = parser.head().unwrap();
                }
                while let Some(frame) = parser.frame().unwrap() {
                    found.push(frame);
                }
            }
            prop_assert_eq!((head, found), (Some(description()), frames));
        }
    }
}
