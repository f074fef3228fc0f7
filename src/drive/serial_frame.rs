//! The V2 serial frame: of EPOS4 on RS232 and USB, and of EPOS2 on USB. Bytes in, bytes out.
//!
//! ```text
//! 90 02 | opcode | words | data, low byte first | CRC, low byte first
//! sync  |<-------- every 0x90 in here is sent twice (stuffing) ----->|
//! ```
//!
//! `words` is the number of 16-bit words of data, at most [`MAX_WORDS`]. The CRC is computed before
//! stuffing and without the sync bytes, over 16-bit words: `opcode + 256 * words`, the data words,
//! and one zero word in place of the CRC; polynomial 0x1021, initial value 0, most significant bit
//! first. The CRC over a received frame with its own CRC is 0. Source: maxon's EPOS4 Communication
//! Guide (2019-11).

#[cfg(test)]
mod tests;

/// The largest number of data words in a frame.
pub const MAX_WORDS: usize = 143;

/// The largest number of data bytes in a frame.
pub(crate) const MAX_DATA: usize = 2 * MAX_WORDS;

/// The largest number of bytes on the wire: sync, and everything after it doubled.
pub const MAX_ENCODED: usize = SYNC.len() + 2 * MAX_BODY;

/// Data link escape: starts a frame, and is doubled inside.
const DLE: u8 = 0x90;

/// Start of text: the second byte of a frame, never escaped.
const STX: u8 = 0x02;

const SYNC: [u8; 2] = [DLE, STX];

const HEADER: usize = 2;

const CRC: usize = 2;

/// Everything after the sync bytes, before stuffing.
const MAX_BODY: usize = HEADER + MAX_DATA + CRC;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SerialFrame<'a> {
    /// The command; 0x00 in every reply.
    pub opcode: u8,
    /// Whole words: an odd number of bytes is sent and received with a zero after it.
    pub data: &'a [u8],
}

/// A frame has more than `MAX_DATA` bytes of data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a frame cannot hold {bytes} bytes of data, at most {MAX_DATA}")]
pub struct FrameTooLong {
    pub bytes: usize,
}

#[derive(Debug, Clone)]
pub struct FrameEncoder {
    wire: [u8; MAX_ENCODED],
    length: usize,
}

impl Default for FrameEncoder {
    fn default() -> Self {
        Self { wire: [0; MAX_ENCODED], length: 0 }
    }
}

impl FrameEncoder {
    /// The bytes that put `frame` on the wire. Fails when the data does not fit a frame.
    pub fn encode(&mut self, frame: SerialFrame<'_>) -> Result<&[u8], FrameTooLong> {
        let bytes = frame.data.len();
        let words = bytes.div_ceil(2);
        if words > MAX_WORDS {
            return Err(FrameTooLong { bytes });
        }
        self.length = 0;
        for byte in SYNC {
            self.push(byte);
        }
        let mut crc = self.push_word(0, u16::from_le_bytes([frame.opcode, words as u8]));
        for pair in frame.data.chunks(2) {
            crc = self.push_word(crc, word(pair));
        }
        self.push_word(0, shift_in(crc, 0));
        Ok(&self.wire[..self.length])
    }

    fn push_word(&mut self, crc: u16, word: u16) -> u16 {
        for byte in word.to_le_bytes() {
            self.push(byte);
            if byte == DLE {
                self.push(DLE);
            }
        }
        shift_in(crc, word)
    }

    fn push(&mut self, byte: u8) {
        // The buffer holds the longest frame with every byte doubled.
        if let Some(free) = self.wire.get_mut(self.length) {
            *free = byte;
            self.length += 1;
        }
    }
}

/// Two bytes as a word; a single byte is padded with zero.
fn word(pair: &[u8]) -> u16 {
    match *pair {
        [low, high] => u16::from_le_bytes([low, high]),
        [low] => u16::from(low),
        _ => 0,
    }
}

/// Shifts a word into the CRC register, most significant bit first.
fn shift_in(crc: u16, word: u16) -> u16 {
    const POLYNOMIAL: u16 = 0x1021;
    (0..16).rev().fold(crc, |crc, bit| {
        let shifted = crc << 1 | (word >> bit & 1);
        if crc & 0x8000 == 0 { shifted } else { shifted ^ POLYNOMIAL }
    })
}

/// The CRC over a body with its own CRC: 0 when the body is undamaged.
fn residue(body: &[u8]) -> u16 {
    body.chunks(2).fold(0, |crc, pair| shift_in(crc, word(pair)))
}

/// Finds frames, byte by byte, also after damage.
///
/// In one case a good frame is lost: when the frame before it ends between the two halves of a
/// doubled 0x90. The 0x90 that starts the good frame then looks like the second half.
/// [`FrameParser::reset`] after a timeout discards the incomplete frame.
#[derive(Debug, Clone)]
pub struct FrameParser {
    state: ParserState,
    body: [u8; MAX_BODY],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParserEvent<'a> {
    None,
    /// This byte completed a frame with a correct CRC.
    Frame(SerialFrame<'a>),
    /// Bytes were lost; the parser continues with the next frame.
    Error(FrameError),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// A complete frame has a wrong CRC.
    Crc,
    /// Unexpected bytes instead of a frame start, an incomplete frame, or an impossible length.
    /// Reported once until the next frame starts.
    LostSync,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ParserState {
    /// Between frames: the next byte should be a 0x90.
    Idle,
    /// The 0x90 of an expected frame; 0x02 should follow.
    Start,
    /// Out of sync: everything but a 0x90 is skipped.
    Hunting,
    /// Out of sync, after a 0x90; 0x02 starts a frame.
    Candidate,
    /// Inside a frame, with this many bytes of its body.
    Body { length: usize },
    /// In the body, after a 0x90 that may be the first half of a pair.
    Escaped { length: usize },
}

impl Default for FrameParser {
    fn default() -> Self {
        Self { state: ParserState::Idle, body: [0; MAX_BODY] }
    }
}

impl FrameParser {
    /// Discards an incomplete frame. Required after every timeout.
    pub fn reset(&mut self) {
        self.state = ParserState::Idle;
    }

    pub fn push(&mut self, byte: u8) -> ParserEvent<'_> {
        use ParserState::{Body, Candidate, Escaped, Hunting, Idle, Start};
        match (self.state, byte) {
            (Idle, DLE) => self.enter(Start),
            (Start | Candidate, STX) => self.enter(Body { length: 0 }),
            (Hunting | Candidate, DLE) => self.enter(Candidate),
            (Hunting | Candidate, _) => self.enter(Hunting),
            (Start, DLE) => self.lose_sync(Candidate),
            (Body { length }, DLE) => self.enter(Escaped { length }),
            (Body { length }, byte) | (Escaped { length }, byte @ DLE) => {
                self.collect(length, byte)
            }
            (Escaped { .. }, STX) => self.lose_sync(Body { length: 0 }),
            (Idle | Start | Escaped { .. }, _) => self.lose_sync(Hunting),
        }
    }

    fn enter(&mut self, state: ParserState) -> ParserEvent<'_> {
        self.state = state;
        ParserEvent::None
    }

    fn lose_sync(&mut self, state: ParserState) -> ParserEvent<'_> {
        self.state = state;
        ParserEvent::Error(FrameError::LostSync)
    }

    fn collect(&mut self, length: usize, byte: u8) -> ParserEvent<'_> {
        let Some(free) = self.body.get_mut(length) else {
            return self.lose_sync(ParserState::Hunting);
        };
        *free = byte;
        let length = length + 1;
        let words = usize::from(self.body[1]);
        if length < HEADER {
            return self.enter(ParserState::Body { length });
        }
        if words > MAX_WORDS {
            return self.lose_sync(ParserState::Hunting);
        }
        if length < HEADER + 2 * words + CRC {
            return self.enter(ParserState::Body { length });
        }
        self.complete(length)
    }

    fn complete(&mut self, length: usize) -> ParserEvent<'_> {
        self.state = ParserState::Idle;
        let body = &self.body[..length];
        if residue(body) != 0 {
            return ParserEvent::Error(FrameError::Crc);
        }
        ParserEvent::Frame(SerialFrame { opcode: body[0], data: &body[HEADER..length - CRC] })
    }
}
