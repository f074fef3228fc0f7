//! Parser of V2 serial frames: finds frames in a stream of bytes.

#[cfg(test)]
mod tests;

use crate::drive::serial_frame::{
    CRC, DLE, HEADER, MAX_BODY, MAX_WORDS, STX, SerialFrame, residue,
};

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

/// How bytes were lost.
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
