//! The receiving half: finds frames in a stream of bytes.

use super::{CRC, DLE, Frame, HEADER, MAX_BODY, MAX_WORDS, STX, residue};

/// Finds frames, byte by byte, and finds them again after damage.
///
/// One case cannot be saved: a frame that is cut between the two halves of a doubled 0x90. The 0x90
/// that starts the next frame then looks like the second half, and that frame is lost with it.
/// [`Parser::reset`] after a time-out forgets the cut frame.
#[derive(Debug, Clone)]
pub struct Parser {
    pub(super) state: State,
    body: [u8; MAX_BODY],
}

/// What a byte led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parsed<'a> {
    /// More bytes are needed.
    Nothing,
    /// This byte completed a frame, and its CRC is right.
    Frame(Frame<'a>),
    /// Bytes were lost; the parser looks for the next frame by itself.
    Damaged(Damage),
}

/// How bytes were lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damage {
    /// A frame was completed with a wrong CRC.
    Crc,
    /// Something stands where a frame should start, a frame was cut, or its length cannot be.
    /// Reported once until the next frame starts.
    LostSync,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    /// Between frames: the next byte should be a 0x90.
    Idle,
    /// The 0x90 of an expected frame; 0x02 should follow.
    Start,
    /// Sync is lost: everything but a 0x90 is skipped.
    Hunting,
    /// Sync is lost, and a 0x90 was found; 0x02 starts a frame.
    Candidate,
    /// Inside a frame, with this many bytes of its body.
    Body { held: usize },
    /// As `Body`, after a 0x90 that may be the first half of a pair.
    Escaped { held: usize },
}

impl Default for Parser {
    fn default() -> Self {
        Self {
            state: State::Idle,
            body: [0; MAX_BODY],
        }
    }
}

impl Parser {
    /// Forgets whatever was begun. Due after every time-out.
    pub fn reset(&mut self) {
        self.state = State::Idle;
    }

    /// Takes the next byte.
    pub fn push(&mut self, byte: u8) -> Parsed<'_> {
        use State::{Body, Candidate, Escaped, Hunting, Idle, Start};
        match (self.state, byte) {
            (Idle, DLE) => self.go_on(Start),
            (Start | Candidate, STX) => self.go_on(Body { held: 0 }),
            (Hunting | Candidate, DLE) => self.go_on(Candidate),
            (Hunting | Candidate, _) => self.go_on(Hunting),
            (Start, DLE) => self.lose(Candidate),
            (Body { held }, DLE) => self.go_on(Escaped { held }),
            (Body { held }, byte) | (Escaped { held }, byte @ DLE) => self.collect(held, byte),
            (Escaped { .. }, STX) => self.lose(Body { held: 0 }),
            (Idle | Start | Escaped { .. }, _) => self.lose(Hunting),
        }
    }

    fn go_on(&mut self, state: State) -> Parsed<'_> {
        self.state = state;
        Parsed::Nothing
    }

    fn lose(&mut self, state: State) -> Parsed<'_> {
        self.state = state;
        Parsed::Damaged(Damage::LostSync)
    }

    fn collect(&mut self, held: usize, byte: u8) -> Parsed<'_> {
        let Some(place) = self.body.get_mut(held) else {
            return self.lose(State::Hunting);
        };
        *place = byte;
        let held = held + 1;
        let words = usize::from(self.body[1]);
        if held < HEADER {
            return self.go_on(State::Body { held });
        }
        if words > MAX_WORDS {
            return self.lose(State::Hunting);
        }
        if held < HEADER + 2 * words + CRC {
            return self.go_on(State::Body { held });
        }
        self.complete(held)
    }

    fn complete(&mut self, held: usize) -> Parsed<'_> {
        self.state = State::Idle;
        let body = &self.body[..held];
        if residue(body) != 0 {
            return Parsed::Damaged(Damage::Crc);
        }
        Parsed::Frame(Frame {
            opcode: body[0],
            data: &body[HEADER..held - CRC],
        })
    }
}
