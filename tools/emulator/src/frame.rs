//! The V2 frame of the EPOS4 serial line, as the drive sees it: requests in, replies out.
//!
//! `90 02 OpCode Len Data.. CRC`, every 0x90 after the first two bytes sent twice. Written from the
//! reference and not from the controller's code, so that a misreading on one side shows on the
//! other.
//!
//! The CRC is the XMODEM one over the unstuffed bytes with each pair swapped: the drive computes it
//! over 16-bit words, most significant bit first, while the line carries the low byte of a word
//! first.

use crc::{CRC_16_XMODEM, Crc};

/// First byte of a frame, and the one that is doubled inside.
const DLE: u8 = 0x90;

/// Second byte of a frame.
const STX: u8 = 0x02;

/// The most data words of a frame (EPOS4 Communication Guide, table of the frame).
const MOST_WORDS: u8 = 143;

/// OpCode of every reply.
const REPLY: u8 = 0x00;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);

/// A request whose CRC is right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// What is asked.
    pub opcode: u8,
    /// Its data, a whole number of words.
    pub data: Vec<u8>,
}

/// What a complete frame turned out to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Incoming {
    /// A request.
    Request(Request),
    /// A frame whose CRC is wrong.
    WrongCrc,
}

/// A reply with these data, ready for the wire. A single last byte is padded to a whole word.
#[must_use]
pub fn reply(data: &[u8]) -> Vec<u8> {
    encode(REPLY, data)
}

/// A frame ready for the wire. Data beyond the longest frame are cut off.
#[must_use]
pub fn encode(opcode: u8, data: &[u8]) -> Vec<u8> {
    let data = &data[..data.len().min(2 * usize::from(MOST_WORDS))];
    let mut body = vec![opcode, data.len().div_ceil(2) as u8];
    body.extend_from_slice(data);
    if data.len() % 2 == 1 {
        body.push(0);
    }
    body.extend_from_slice(&checksum(&body).to_le_bytes());
    let stuffed = body
        .iter()
        .flat_map(|byte| std::iter::repeat_n(*byte, if *byte == DLE { 2 } else { 1 }));
    [DLE, STX].into_iter().chain(stuffed).collect()
}

/// CRC over an even number of bytes.
fn checksum(body: &[u8]) -> u16 {
    let mut digest = CRC.digest();
    for pair in body.chunks(2) {
        pair.iter().rev().for_each(|byte| digest.update(&[*byte]));
    }
    digest.finalize()
}

/// Takes requests apart, byte by byte.
#[derive(Debug, Clone, Default)]
pub struct Parser {
    state: State,
    body: Vec<u8>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum State {
    /// Looking for the first byte of a frame.
    #[default]
    Hunt,
    /// The first byte came; the second must follow.
    Sync,
    /// Inside.
    Body,
    /// Inside, after the first half of a doubled byte.
    Escape,
}

impl Parser {
    /// Takes the next byte; gives the frame that it completes.
    pub fn push(&mut self, byte: u8) -> Option<Incoming> {
        match (self.state, byte) {
            (State::Hunt, DLE) => self.state = State::Sync,
            (State::Hunt, _) | (State::Sync, DLE) => {}
            (State::Sync | State::Escape, STX) => self.start(),
            (State::Body, DLE) => self.state = State::Escape,
            (State::Body, _) | (State::Escape, DLE) => return self.take(byte),
            (State::Sync | State::Escape, _) => self.reset(),
        }
        None
    }

    /// Whether the beginning of a frame is held.
    #[must_use]
    pub fn is_partial(&self) -> bool {
        self.state != State::Hunt
    }

    /// Forgets what it holds.
    pub fn reset(&mut self) {
        self.state = State::Hunt;
        self.body.clear();
    }

    fn start(&mut self) {
        self.state = State::Body;
        self.body.clear();
    }

    fn take(&mut self, byte: u8) -> Option<Incoming> {
        self.state = State::Body;
        self.body.push(byte);
        let words = *self.body.get(1)?;
        if words > MOST_WORDS {
            self.reset();
            return None;
        }
        if self.body.len() < 2 + 2 * usize::from(words) + 2 {
            return None;
        }
        let body = std::mem::take(&mut self.body);
        self.reset();
        // Over a frame with its own CRC at the end, the remainder is 0.
        if checksum(&body) != 0 {
            return Some(Incoming::WrongCrc);
        }
        Some(Incoming::Request(Request {
            opcode: body[0],
            data: body[2..body.len() - 2].to_vec(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn bytes(text: &str) -> Vec<u8> {
        text.split_whitespace()
            .map(|byte| u8::from_str_radix(byte, 16).unwrap())
            .collect()
    }

    fn parse(parser: &mut Parser, wire: &[u8]) -> Vec<Incoming> {
        wire.iter().filter_map(|byte| parser.push(*byte)).collect()
    }

    /// Requests of the reference, sections 1.9: captures from outside first, then computed ones.
    const REQUESTS: &[(&str, u8, &str)] = &[
        ("90 02 60 02 01 B0 30 00 2E 62", 0x60, "01 B0 30 00"),
        ("90 02 60 02 01 40 60 00 96 A7", 0x60, "01 40 60 00"),
        (
            "90 02 68 04 01 40 60 00 0F 00 00 00 B3 07",
            0x68,
            "01 40 60 00 0F 00 00 00",
        ),
        ("90 02 60 02 01 41 60 00 22 D1", 0x60, "01 41 60 00"),
        ("90 02 60 02 01 61 60 00 6C E6", 0x60, "01 61 60 00"),
        (
            "90 02 68 04 01 60 60 00 01 00 00 00 DA 67",
            0x68,
            "01 60 60 00 01 00 00 00",
        ),
        ("90 02 60 02 01 81 60 00 86 62", 0x60, "01 81 60 00"),
        ("90 02 60 02 01 83 60 00 EE 8F", 0x60, "01 83 60 00"),
        ("90 02 60 02 01 84 60 00 C3 DE", 0x60, "01 84 60 00"),
        (
            "90 02 68 04 01 81 60 00 E7 03 00 00 7D D9",
            0x68,
            "01 81 60 00 E7 03 00 00",
        ),
        (
            "90 02 68 04 01 83 60 00 10 27 00 00 A6 CD",
            0x68,
            "01 83 60 00 10 27 00 00",
        ),
        (
            "90 02 68 04 01 84 60 00 10 27 00 00 BE 0A",
            0x68,
            "01 84 60 00 10 27 00 00",
        ),
        ("90 02 60 02 01 7A 60 00 D4 E3", 0x60, "01 7A 60 00"),
        (
            "90 02 68 04 01 7A 60 00 E8 03 00 00 6E 6E",
            0x68,
            "01 7A 60 00 E8 03 00 00",
        ),
        (
            "90 02 68 04 01 03 10 00 00 00 00 00 A1 08",
            0x68,
            "01 03 10 00 00 00 00 00",
        ),
        (
            "90 02 68 04 01 10 10 01 73 61 76 65 70 FC",
            0x68,
            "01 10 10 01 73 61 76 65",
        ),
        ("90 02 60 02 01 64 60 00 29 5A", 0x60, "01 64 60 00"),
        ("90 02 60 02 02 41 60 00 72 88", 0x60, "02 41 60 00"),
        ("90 02 60 02 02 64 60 00 79 03", 0x60, "02 64 60 00"),
        ("90 02 60 02 01 D1 30 02 2A 2B", 0x60, "01 D1 30 02"),
        ("90 02 60 02 01 18 10 01 C8 1A", 0x60, "01 18 10 01"),
        (
            "90 02 68 04 01 40 60 00 80 00 00 00 D8 10",
            0x68,
            "01 40 60 00 80 00 00 00",
        ),
        (
            "90 02 68 04 02 40 60 00 07 00 00 00 90 90 76",
            0x68,
            "02 40 60 00 07 00 00 00",
        ),
        (
            "90 02 68 04 01 7A 60 00 FF FF FF FF ED 65",
            0x68,
            "01 7A 60 00 FF FF FF FF",
        ),
        (
            "90 02 68 04 01 7A 60 00 90 90 00 00 00 1B 84",
            0x68,
            "01 7A 60 00 90 00 00 00",
        ),
        (
            "90 02 68 04 01 7A 60 00 6C F0 FF FF 6A 90 90",
            0x68,
            "01 7A 60 00 6C F0 FF FF",
        ),
        (
            "90 02 68 04 01 7A 60 00 90 90 90 90 90 90 90 90 D6 D9",
            0x68,
            "01 7A 60 00 90 90 90 90",
        ),
        ("90 02 70 02 01 00 81 00 5F 20", 0x70, "01 00 81 00"),
        ("90 02 70 02 00 00 01 00 E7 86", 0x70, "00 00 01 00"),
        ("90 02 81 02 01 08 10 00 03 A3", 0x81, "01 08 10 00"),
    ];

    /// Replies of the reference.
    const REPLIES: &[(&str, &str)] = &[
        (
            "90 02 00 04 00 00 00 00 01 90 90 00 00 9A 5C",
            "00 00 00 00 01 90 00 00",
        ),
        ("90 02 00 02 00 00 00 00 40 8B", "00 00 00 00"),
        (
            "90 02 00 04 00 00 00 00 37 02 00 00 68 00",
            "00 00 00 00 37 02 00 00",
        ),
        (
            "90 02 00 04 00 00 00 00 C7 CF FF FF 17 74",
            "00 00 00 00 C7 CF FF FF",
        ),
        (
            "90 02 00 04 00 00 00 00 92 01 02 00 9A ED",
            "00 00 00 00 92 01 02 00",
        ),
        ("90 02 00 02 00 00 02 06 A4 01", "00 00 02 06"),
        (
            "90 02 00 04 00 00 02 06 00 00 00 00 57 64",
            "00 00 02 06 00 00 00 00",
        ),
        ("90 02 00 02 30 00 09 06 6A 75", "30 00 09 06"),
        ("90 02 00 02 22 00 00 08 4F EA", "22 00 00 08"),
        ("90 02 00 02 04 00 04 05 F1 E8", "04 00 04 05"),
        ("90 02 00 02 BF FF 00 0F 13 02", "BF FF 00 0F"),
    ];

    #[test]
    fn requests_of_the_reference_are_understood() {
        for (wire, opcode, data) in REQUESTS {
            let request = Incoming::Request(Request {
                opcode: *opcode,
                data: bytes(data),
            });
            assert_eq!(
                parse(&mut Parser::default(), &bytes(wire)),
                [request],
                "{wire}"
            );
            assert_eq!(encode(*opcode, &bytes(data)), bytes(wire), "{wire}");
        }
    }

    #[test]
    fn replies_are_those_of_the_reference() {
        for (wire, data) in REPLIES {
            assert_eq!(reply(&bytes(data)), bytes(wire));
        }
    }

    #[test]
    fn a_wrong_crc_is_noticed_and_the_next_frame_is_read() {
        let mut wire = bytes("90 02 60 02 01 41 60 00 23 D1");
        wire.extend(bytes("90 02 60 02 01 64 60 00 29 5A"));
        let incoming = parse(&mut Parser::default(), &wire);
        assert!(matches!(
            incoming[..],
            [Incoming::WrongCrc, Incoming::Request(_)]
        ));
    }

    #[test]
    fn a_frame_that_starts_over_replaces_the_one_before() {
        let mut wire = bytes("90 02 60 02 01");
        wire.extend(bytes("90 02 60 02 01 64 60 00 29 5A"));
        assert_eq!(parse(&mut Parser::default(), &wire).len(), 1);
    }

    #[test]
    fn a_length_beyond_the_longest_frame_is_dropped() {
        let mut parser = Parser::default();
        assert_eq!(parse(&mut parser, &[DLE, STX, 0x60, 145]), []);
        assert!(!parser.is_partial());
    }

    proptest! {
        #[test]
        fn whatever_is_sent_arrives(opcode: u8, data in prop::collection::vec(any::<u8>(), 0..60)) {
            let incoming = parse(&mut Parser::default(), &encode(opcode, &data));
            let mut padded = data.clone();
            padded.resize(data.len().next_multiple_of(2), 0);
            prop_assert_eq!(incoming, vec![Incoming::Request(Request { opcode, data: padded })]);
        }

        #[test]
        fn noise_never_confuses_it_for_long(noise in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut parser = Parser::default();
            parse(&mut parser, &noise);
            parser.reset();
            prop_assert_eq!(parse(&mut parser, &encode(0x60, &[1, 0x41, 0x60, 0])).len(), 1);
        }

        #[test]
        fn one_flipped_bit_is_never_taken_for_a_request(bit in 16..80usize) {
            let mut wire = encode(0x60, &[1, 0x64, 0x60, 0]);
            wire[bit / 8] ^= 1 << (bit % 8);
            let incoming = parse(&mut Parser::default(), &wire);
            prop_assert!(!incoming.iter().any(|frame| matches!(frame, Incoming::Request(_))), "{:?}", incoming);
        }
    }
}
