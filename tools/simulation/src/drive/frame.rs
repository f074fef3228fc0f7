//! The V2 frame of the EPOS4 serial line from the drive's side: requests in, replies out.
//!
//! `90 02 OpCode Len Data.. CRC`, every 0x90 after the first two bytes sent twice. Written from the
//! reference and independent of the controller's code: a misreading on one side fails the tests.
//!
//! The CRC is the XMODEM one over the unstuffed bytes with each pair swapped: the drive computes it
//! over words, most significant bit first; the line carries the low byte of a word first.

use crc::{CRC_16_XMODEM, Crc};

/// First byte of a frame, and the one that is doubled inside.
const DLE: u8 = 0x90;
const STX: u8 = 0x02;
/// Maximum data words of a frame (EPOS4 Communication Guide, table of the frame).
const MAX_WORDS: u8 = 143;
/// OpCode of every reply.
const REPLY: u8 = 0x00;
const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);

/// A request with a valid CRC.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    pub opcode: u8,
    /// Its data, a whole number of words.
    pub data: Vec<u8>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Incoming {
    Request(Request),
    WrongCrc,
}

/// The frame of a reply. An odd number of bytes is padded to a whole word.
pub fn reply(data: &[u8]) -> Vec<u8> {
    encode(REPLY, data)
}

/// A frame, ready for the wire. Data beyond the longest frame are truncated.
pub fn encode(opcode: u8, data: &[u8]) -> Vec<u8> {
    let data = &data[..data.len().min(2 * usize::from(MAX_WORDS))];
    let mut body = vec![opcode, data.len().div_ceil(2) as u8];
    body.extend_from_slice(data);
    if data.len() % 2 == 1 {
        body.push(0);
    }
    body.extend_from_slice(&checksum(&body).to_le_bytes());
    let stuffed =
        body.iter().flat_map(|byte| std::iter::repeat_n(*byte, if *byte == DLE { 2 } else { 1 }));
    [DLE, STX].into_iter().chain(stuffed).collect()
}

/// CRC over an even number of bytes.
fn checksum(body: &[u8]) -> u16 {
    let mut digest = CRC.digest();
    for pair in body.chunks(2) {
        for byte in pair.iter().rev() {
            digest.update(&[*byte]);
        }
    }
    digest.finalize()
}

/// Byte-by-byte parser of requests.
#[derive(Debug, Clone, Default)]
pub struct Parser {
    state: State,
    body: Vec<u8>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum State {
    /// Searches for the first byte of a frame.
    #[default]
    Hunt,
    /// After the first byte.
    Sync,
    Body,
    /// Inside, after the first half of a doubled byte.
    Escape,
}

impl Parser {
    /// Takes the next byte. Returns the frame that it completes.
    pub fn push(&mut self, byte: u8) -> Option<Incoming> {
        match (self.state, byte) {
            (State::Hunt, DLE) => self.state = State::Sync,
            (State::Hunt, _) | (State::Sync, DLE) => {}
            (State::Sync | State::Escape, STX) => {
                self.reset();
                self.state = State::Body;
            }
            (State::Body, DLE) => self.state = State::Escape,
            (State::Body, _) | (State::Escape, DLE) => return self.take(byte),
            (State::Sync | State::Escape, _) => self.reset(),
        }
        None
    }

    /// Whether it holds the beginning of a frame.
    pub fn is_partial(&self) -> bool {
        self.state != State::Hunt
    }

    pub fn reset(&mut self) {
        self.state = State::Hunt;
        self.body.clear();
    }

    fn take(&mut self, byte: u8) -> Option<Incoming> {
        self.state = State::Body;
        self.body.push(byte);
        let words = *self.body.get(1)?;
        if words > MAX_WORDS {
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
        Some(Incoming::Request(Request { opcode: body[0], data: body[2..body.len() - 2].to_vec() }))
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    fn bytes(text: &str) -> Vec<u8> {
        text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
    }

    fn parse(parser: &mut Parser, wire: &[u8]) -> Vec<Incoming> {
        wire.iter().filter_map(|byte| parser.push(*byte)).collect()
    }

    /// Requests of the reference, section 1.9, captures first. Columns: frame; opcode and data.
    const REQUESTS: &str = "\
90 02 60 02 01 B0 30 00 2E 62                         | 60 01 B0 30 00
90 02 60 02 01 40 60 00 96 A7                         | 60 01 40 60 00
90 02 68 04 01 40 60 00 0F 00 00 00 B3 07             | 68 01 40 60 00 0F 00 00 00
90 02 60 02 01 41 60 00 22 D1                         | 60 01 41 60 00
90 02 60 02 01 61 60 00 6C E6                         | 60 01 61 60 00
90 02 68 04 01 60 60 00 01 00 00 00 DA 67             | 68 01 60 60 00 01 00 00 00
90 02 60 02 01 81 60 00 86 62                         | 60 01 81 60 00
90 02 60 02 01 83 60 00 EE 8F                         | 60 01 83 60 00
90 02 60 02 01 84 60 00 C3 DE                         | 60 01 84 60 00
90 02 68 04 01 81 60 00 E7 03 00 00 7D D9             | 68 01 81 60 00 E7 03 00 00
90 02 68 04 01 83 60 00 10 27 00 00 A6 CD             | 68 01 83 60 00 10 27 00 00
90 02 68 04 01 84 60 00 10 27 00 00 BE 0A             | 68 01 84 60 00 10 27 00 00
90 02 60 02 01 7A 60 00 D4 E3                         | 60 01 7A 60 00
90 02 68 04 01 7A 60 00 E8 03 00 00 6E 6E             | 68 01 7A 60 00 E8 03 00 00
90 02 68 04 01 03 10 00 00 00 00 00 A1 08             | 68 01 03 10 00 00 00 00 00
90 02 68 04 01 10 10 01 73 61 76 65 70 FC             | 68 01 10 10 01 73 61 76 65
90 02 60 02 01 64 60 00 29 5A                         | 60 01 64 60 00
90 02 60 02 02 41 60 00 72 88                         | 60 02 41 60 00
90 02 60 02 02 64 60 00 79 03                         | 60 02 64 60 00
90 02 60 02 01 D1 30 02 2A 2B                         | 60 01 D1 30 02
90 02 60 02 01 18 10 01 C8 1A                         | 60 01 18 10 01
90 02 68 04 01 40 60 00 80 00 00 00 D8 10             | 68 01 40 60 00 80 00 00 00
90 02 68 04 02 40 60 00 07 00 00 00 90 90 76          | 68 02 40 60 00 07 00 00 00
90 02 68 04 01 7A 60 00 FF FF FF FF ED 65             | 68 01 7A 60 00 FF FF FF FF
90 02 68 04 01 7A 60 00 90 90 00 00 00 1B 84          | 68 01 7A 60 00 90 00 00 00
90 02 68 04 01 7A 60 00 6C F0 FF FF 6A 90 90          | 68 01 7A 60 00 6C F0 FF FF
90 02 68 04 01 7A 60 00 90 90 90 90 90 90 90 90 D6 D9 | 68 01 7A 60 00 90 90 90 90
90 02 70 02 01 00 81 00 5F 20                         | 70 01 00 81 00
90 02 70 02 00 00 01 00 E7 86                         | 70 00 00 01 00
90 02 81 02 01 08 10 00 03 A3                         | 81 01 08 10 00";

    /// Replies of the reference.
    const REPLIES: &str = "\
90 02 00 04 00 00 00 00 01 90 90 00 00 9A 5C          | 00 00 00 00 00 01 90 00 00
90 02 00 02 00 00 00 00 40 8B                         | 00 00 00 00 00
90 02 00 04 00 00 00 00 37 02 00 00 68 00             | 00 00 00 00 00 37 02 00 00
90 02 00 04 00 00 00 00 C7 CF FF FF 17 74             | 00 00 00 00 00 C7 CF FF FF
90 02 00 04 00 00 00 00 92 01 02 00 9A ED             | 00 00 00 00 00 92 01 02 00
90 02 00 02 00 00 02 06 A4 01                         | 00 00 00 02 06
90 02 00 04 00 00 02 06 00 00 00 00 57 64             | 00 00 00 02 06 00 00 00 00
90 02 00 02 30 00 09 06 6A 75                         | 00 30 00 09 06
90 02 00 02 22 00 00 08 4F EA                         | 00 22 00 00 08
90 02 00 02 04 00 04 05 F1 E8                         | 00 04 00 04 05
90 02 00 02 BF FF 00 0F 13 02                         | 00 BF FF 00 0F";

    #[test]
    fn frames_of_the_reference_are_decoded_and_encoded() {
        for row in REQUESTS.lines().chain(REPLIES.lines()) {
            let (wire, content) = row.split_once('|').unwrap();
            let (wire, content) = (bytes(wire), bytes(content));
            let (opcode, data) = (content[0], content[1..].to_vec());
            assert_eq!(encode(opcode, &data), wire, "{row}");
            let request = Incoming::Request(Request { opcode, data });
            assert_eq!(parse(&mut Parser::default(), &wire), [request], "{row}");
        }
        assert_eq!(reply(&[0; 4]), bytes("90 02 00 02 00 00 00 00 40 8B"));
    }

    #[test]
    fn the_frame_after_a_wrong_crc_is_read() {
        let mut wire = bytes("90 02 60 02 01 41 60 00 23 D1");
        wire.extend(bytes("90 02 60 02 01 64 60 00 29 5A"));
        let incoming = parse(&mut Parser::default(), &wire);
        assert!(matches!(incoming[..], [Incoming::WrongCrc, Incoming::Request(_)]));
    }

    proptest! {
        #[test]
        fn noise_does_not_block_the_parser_after_a_reset(noise in vec(any::<u8>(), 0..200)) {
            let mut parser = Parser::default();
            parse(&mut parser, &noise);
            parser.reset();
            prop_assert_eq!(parse(&mut parser, &encode(0x60, &[1, 0x41, 0x60, 0])).len(), 1);
        }

        #[test]
        fn a_flipped_bit_never_yields_a_request(bit in 16..80usize) {
            let mut wire = encode(0x60, &[1, 0x64, 0x60, 0]);
            wire[bit / 8] ^= 1 << (bit % 8);
            let incoming = parse(&mut Parser::default(), &wire);
            let is_request = |frame: &Incoming| matches!(frame, Incoming::Request(_));
            prop_assert!(!incoming.iter().any(is_request), "{:?}", incoming);
        }
    }
}
