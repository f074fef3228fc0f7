//! The V2 frame that EPOS4 speaks on RS232 and USB, and EPOS2 on USB. Bytes in, bytes out.
//!
//! ```text
//! 90 02 | opcode | words | data, low byte first | CRC, low byte first
//! sync  |<-------- every 0x90 in here is sent twice (stuffing) ----->|
//! ```
//!
//! `words` counts the 16-bit words of data, at most [`MAX_WORDS`]. The CRC is computed before
//! stuffing and without the sync bytes, over 16-bit words: `opcode + 256 * words`, the data words,
//! and one zero word where the CRC will stand; polynomial 0x1021, starting from 0, most significant
//! bit first. The same sum over a received frame with its CRC is 0.

mod parser;
#[cfg(test)]
mod tests;

pub use parser::{Damage, Parsed, Parser};

/// The most data words that a frame can have.
pub const MAX_WORDS: usize = 143;

/// The most data bytes that a frame can have.
pub const MAX_DATA: usize = 2 * MAX_WORDS;

/// The most bytes that a frame can take on the wire: sync, and everything after it doubled.
pub const MAX_ENCODED: usize = SYNC.len() + 2 * MAX_BODY;

/// Data link escape: starts a frame, and is doubled inside.
const DLE: u8 = 0x90;

/// Start of text: the second byte of a frame, never escaped.
const STX: u8 = 0x02;

const SYNC: [u8; 2] = [DLE, STX];

/// Opcode and number of words.
const HEADER: usize = 2;

const CRC: usize = 2;

/// Everything after the sync bytes, before stuffing.
const MAX_BODY: usize = HEADER + MAX_DATA + CRC;

/// What a frame says: an opcode and its data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The command; 0x00 in every reply.
    pub opcode: u8,
    /// The data. Frames hold whole words: an odd number of bytes is sent with a zero after it, and
    /// arrives so.
    pub data: &'a [u8],
}

/// A frame has more than [`MAX_DATA`] bytes of data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a frame cannot hold {bytes} bytes of data, at most {MAX_DATA}")]
pub struct TooLong {
    /// The number of bytes.
    pub bytes: usize,
}

/// Encodes frames into a buffer of its own.
#[derive(Debug, Clone)]
pub struct Encoder {
    wire: [u8; MAX_ENCODED],
    held: usize,
}

impl Default for Encoder {
    fn default() -> Self {
        Self {
            wire: [0; MAX_ENCODED],
            held: 0,
        }
    }
}

impl Encoder {
    /// The bytes that put `frame` on the wire.
    ///
    /// # Errors
    ///
    /// When the data does not fit a frame.
    pub fn encode(&mut self, frame: Frame<'_>) -> Result<&[u8], TooLong> {
        let words = frame.data.len().div_ceil(2);
        if words > MAX_WORDS {
            return Err(TooLong {
                bytes: frame.data.len(),
            });
        }
        self.held = 0;
        SYNC.into_iter().for_each(|byte| self.put(byte));
        let mut crc = self.put_word(0, u16::from_le_bytes([frame.opcode, words as u8]));
        for pair in frame.data.chunks(2) {
            crc = self.put_word(crc, word(pair));
        }
        self.put_word(0, shift_in(crc, 0));
        Ok(&self.wire[..self.held])
    }

    fn put_word(&mut self, crc: u16, word: u16) -> u16 {
        for byte in word.to_le_bytes() {
            self.put(byte);
            if byte == DLE {
                self.put(DLE);
            }
        }
        shift_in(crc, word)
    }

    fn put(&mut self, byte: u8) {
        // The buffer holds the longest frame with every byte doubled, so the place is always there.
        if let Some(place) = self.wire.get_mut(self.held) {
            *place = byte;
            self.held += 1;
        }
    }
}

/// A pair of bytes as a word; a lonely byte is padded.
pub(super) fn word(pair: &[u8]) -> u16 {
    match *pair {
        [low, high] => u16::from_le_bytes([low, high]),
        [low] => u16::from(low),
        _ => 0,
    }
}

/// Shifts a word into the CRC register, most significant bit first.
pub(super) fn shift_in(crc: u16, word: u16) -> u16 {
    const POLYNOMIAL: u16 = 0x1021;
    (0..16).rev().fold(crc, |crc, bit| {
        let shifted = crc << 1 | (word >> bit & 1);
        if crc & 0x8000 == 0 {
            shifted
        } else {
            shifted ^ POLYNOMIAL
        }
    })
}

/// The CRC over a whole body with its own CRC: 0 when nothing was damaged.
fn residue(body: &[u8]) -> u16 {
    body.chunks(2)
        .fold(0, |crc, pair| shift_in(crc, word(pair)))
}
