use proptest::collection::vec;
use proptest::prelude::*;

use super::*;
use crate::config::Family;
use crate::drive::capture::file::{CaptureFile, from_bytes, to_bytes};
use crate::drive::capture::{CapturedPort, LineEvent, LineEventKind, Outcome};
use crate::drive::link::replay::{LineReplay, replay};
use crate::drive::object::AbortCode;
use crate::units::Nanos;

/// Reference frames: name, bytes on the wire, opcode, data. The first 18 are from captures and from
/// maxon's own example, the others are computed. EPOS2 over USB has the same frame with other
/// opcodes and another order of the parameters.
const REFERENCE: &str = "\
read 0x30B0|90 02 60 02 01 B0 30 00 2E 62|60|01 B0 30 00
reply 0x9001|90 02 00 04 00 00 00 00 01 90 90 00 00 9A 5C|00|00 00 00 00 01 90 00 00
read controlword|90 02 60 02 01 40 60 00 96 A7|60|01 40 60 00
controlword 0x000F|90 02 68 04 01 40 60 00 0F 00 00 00 B3 07|68|01 40 60 00 0F 00 00 00
read statusword|90 02 60 02 01 41 60 00 22 D1|60|01 41 60 00
read mode display|90 02 60 02 01 61 60 00 6C E6|60|01 61 60 00
mode 1|90 02 68 04 01 60 60 00 01 00 00 00 DA 67|68|01 60 60 00 01 00 00 00
read 0x6081|90 02 60 02 01 81 60 00 86 62|60|01 81 60 00
read 0x6083|90 02 60 02 01 83 60 00 EE 8F|60|01 83 60 00
read 0x6084|90 02 60 02 01 84 60 00 C3 DE|60|01 84 60 00
0x6081 = 999|90 02 68 04 01 81 60 00 E7 03 00 00 7D D9|68|01 81 60 00 E7 03 00 00
0x6083 = 10000|90 02 68 04 01 83 60 00 10 27 00 00 A6 CD|68|01 83 60 00 10 27 00 00
0x6084 = 10000|90 02 68 04 01 84 60 00 10 27 00 00 BE 0A|68|01 84 60 00 10 27 00 00
read target|90 02 60 02 01 7A 60 00 D4 E3|60|01 7A 60 00
target 1000|90 02 68 04 01 7A 60 00 E8 03 00 00 6E 6E|68|01 7A 60 00 E8 03 00 00
clear history|90 02 68 04 01 03 10 00 00 00 00 00 A1 08|68|01 03 10 00 00 00 00 00
store all|90 02 68 04 01 10 10 01 73 61 76 65 70 FC|68|01 10 10 01 73 61 76 65
read position|90 02 60 02 01 64 60 00 29 5A|60|01 64 60 00
read statusword N2|90 02 60 02 02 41 60 00 72 88|60|02 41 60 00
read position N2|90 02 60 02 02 64 60 00 79 03|60|02 64 60 00
read velocity|90 02 60 02 01 6C 60 00 EA DF|60|01 6C 60 00
read error code|90 02 60 02 01 3F 60 00 0D 31|60|01 3F 60 00
read current|90 02 60 02 01 D1 30 02 2A 2B|60|01 D1 30 02
read device type|90 02 60 02 01 00 10 00 9D B7|60|01 00 10 00
read vendor|90 02 60 02 01 18 10 01 C8 1A|60|01 18 10 01
controlword 0x0000|90 02 68 04 01 40 60 00 00 00 00 00 82 2B|68|01 40 60 00 00 00 00 00
controlword 0x0002|90 02 68 04 01 40 60 00 02 00 00 00 E2 45|68|01 40 60 00 02 00 00 00
controlword 0x0006|90 02 68 04 01 40 60 00 06 00 00 00 22 99|68|01 40 60 00 06 00 00 00
controlword 0x0007|90 02 68 04 01 40 60 00 07 00 00 00 12 AE|68|01 40 60 00 07 00 00 00
stuffed CRC, low|90 02 68 04 02 40 60 00 07 00 00 00 90 90 76|68|02 40 60 00 07 00 00 00
controlword 0x000F N2|90 02 68 04 02 40 60 00 0F 00 00 00 31 DF|68|02 40 60 00 0F 00 00 00
controlword 0x003F|90 02 68 04 01 40 60 00 3F 00 00 00 16 C2|68|01 40 60 00 3F 00 00 00
halt 0x010F|90 02 68 04 01 40 60 00 0F 01 00 00 07 71|68|01 40 60 00 0F 01 00 00
fault reset|90 02 68 04 01 40 60 00 80 00 00 00 D8 10|68|01 40 60 00 80 00 00 00
mode 8|90 02 68 04 01 60 60 00 08 00 00 00 4B F9|68|01 60 60 00 08 00 00 00
0x60C2:01 = 0|90 02 68 04 01 C2 60 01 00 00 00 00 05 1C|68|01 C2 60 01 00 00 00 00
target 0|90 02 68 04 01 7A 60 00 00 00 00 00 22 FC|68|01 7A 60 00 00 00 00 00
target -1|90 02 68 04 01 7A 60 00 FF FF FF FF ED 65|68|01 7A 60 00 FF FF FF FF
stuffed data|90 02 68 04 01 7A 60 00 90 90 00 00 00 1B 84|68|01 7A 60 00 90 00 00 00
stuffed CRC, high|90 02 68 04 01 7A 60 00 6C F0 FF FF 6A 90 90|68|01 7A 60 00 6C F0 FF FF
all data stuffed|90 02 68 04 01 7A 60 00 90 90 90 90 90 90 90 90 D6 D9|68|01 7A 60 00 90 90 90 90
write ok|90 02 00 02 00 00 00 00 40 8B|00|00 00 00 00
statusword 0x0237|90 02 00 04 00 00 00 00 37 02 00 00 68 00|00|00 00 00 00 37 02 00 00
position -12345|90 02 00 04 00 00 00 00 C7 CF FF FF 17 74|00|00 00 00 00 C7 CF FF FF
device type|90 02 00 04 00 00 00 00 92 01 02 00 9A ED|00|00 00 00 00 92 01 02 00
no such object, short|90 02 00 02 00 00 02 06 A4 01|00|00 00 02 06
no such object, long|90 02 00 04 00 00 02 06 00 00 00 00 57 64|00|00 00 02 06 00 00 00 00
value range|90 02 00 02 30 00 09 06 6A 75|00|30 00 09 06
wrong state|90 02 00 02 22 00 00 08 4F EA|00|22 00 00 08
wrong CRC|90 02 00 02 04 00 04 05 F1 E8|00|04 00 04 05
illegal command|90 02 00 02 BF FF 00 0F 13 02|00|BF FF 00 0F
reset node 1|90 02 70 02 01 00 81 00 5F 20|70|01 00 81 00
start all nodes|90 02 70 02 00 00 01 00 E7 86|70|00 00 01 00
segmented read|90 02 81 02 01 08 10 00 03 A3|81|01 08 10 00
EPOS2 read statusword|90 02 10 02 41 60 00 01 64 CF|10|41 60 00 01
EPOS2 read position|90 02 10 02 64 60 00 01 52 A2|10|64 60 00 01
EPOS2 controlword|90 02 11 04 40 60 00 01 0F 00 00 00 2D 2C|11|40 60 00 01 0F 00 00 00
EPOS2 mode -1|90 02 11 04 60 60 00 01 FF 00 00 00 89 A1|11|60 60 00 01 FF 00 00 00
EPOS2 target N1|90 02 11 04 62 20 00 01 E8 03 00 00 95 6A|11|62 20 00 01 E8 03 00 00
EPOS2 target N2|90 02 11 04 62 20 00 02 E8 03 00 00 75 A4|11|62 20 00 02 E8 03 00 00";

struct Reference {
    name: &'static str,
    wire: Vec<u8>,
    opcode: u8,
    data: Vec<u8>,
}

fn reference() -> impl Iterator<Item = Reference> {
    REFERENCE.lines().map(|line| {
        let [name, wire, opcode, data]: [&str; 4] =
            line.split('|').collect::<Vec<_>>().try_into().unwrap();
        let (wire, opcode, data) = (bytes(wire), bytes(opcode)[0], bytes(data));
        Reference { name, wire, opcode, data }
    })
}

fn good_wire() -> Vec<u8> {
    reference().next().unwrap().wire
}

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn encode(opcode: u8, data: &[u8]) -> Vec<u8> {
    FrameEncoder::default().encode(SerialFrame { opcode, data }).unwrap().to_vec()
}

/// The frames and the damage that a parser finds in some bytes.
fn feed(parser: &mut FrameParser, wire: &[u8]) -> (Vec<(u8, Vec<u8>)>, Vec<FrameError>) {
    let (mut frames, mut damage) = (Vec::new(), Vec::new());
    for &byte in wire {
        match parser.push(byte) {
            ParserEvent::None => {}
            ParserEvent::Frame(frame) => frames.push((frame.opcode, frame.data.to_vec())),
            ParserEvent::Error(kind) => damage.push(kind),
        }
    }
    (frames, damage)
}

#[test]
fn every_reference_frame_is_encoded_and_parsed_byte_for_byte() {
    for Reference { name, wire, opcode, data } in reference() {
        assert_eq!(encode(opcode, &data), wire, "{name}");
        let found = feed(&mut FrameParser::default(), &wire);
        assert_eq!(found, (vec![(opcode, data)], vec![]), "{name}");
    }
}

#[test]
fn data_beyond_the_longest_frame_is_refused() {
    assert_eq!(encode(1, &[DLE; MAX_DATA]).len(), 2 + 2 * MAX_DATA + 4);
    assert_eq!(
        FrameEncoder::default().encode(SerialFrame { opcode: 1, data: &[0; 287] }),
        Err(FrameTooLong { bytes: 287 })
    );
}

#[test]
fn lost_sync_is_reported_once_and_the_next_frame_is_found() {
    let good = reference().nth(1).unwrap();
    for (lost, frames) in [
        // An impossible length; 0x90 words arrive doubled.
        ("90 02 00 91", 0),
        ("90 02 00 90 90", 0),
        // Garbage between frames, and a new start inside a frame.
        ("0A 0D 90 90 55 90", 1),
        ("90 02 60 02 01 41", 1),
    ] {
        let next = if frames > 0 { &good.wire[..] } else { &[] };
        let found = feed(&mut FrameParser::default(), &[&bytes(lost), next].concat());
        let expected = vec![(0x00, good.data.clone()); frames];
        assert_eq!(found, (expected, vec![FrameError::LostSync]), "{lost}");
    }
}

#[test]
fn frame_cut_inside_doubled_byte_loses_the_next_unless_reset() {
    let cut = bytes("90 02 00 04 00 00 00 00 01 90");
    let good = bytes("90 02 00 02 00 00 00 00 40 8B");

    // Without a reset the protocol cannot distinguish the frames.
    for (reset, frames) in [(false, vec![]), (true, vec![(0x00, vec![0; 4])])] {
        let mut parser = FrameParser::default();
        feed(&mut parser, &cut);
        if reset {
            parser.reset();
        }
        assert_eq!(feed(&mut parser, &good).0, frames);
    }
}

/// Every state that the parser can be in, with every word count for those inside a frame.
fn every_state() -> impl Iterator<Item = FrameParser> {
    use ParserState::{Body, Candidate, Escaped, Hunting, Idle, Start};
    let outside = [Idle, Start, Hunting, Candidate].map(|state| (state, 0));
    let inside = (0..=MAX_WORDS).flat_map(|words| {
        (0..HEADER + 2 * words + CRC).flat_map(move |length| {
            [Body { length }, Escaped { length }].map(|state| (state, words as u8))
        })
    });
    outside.into_iter().chain(inside).map(|(state, words)| {
        let mut body = [0x5A; MAX_BODY];
        body[1] = words;
        FrameParser { state, body }
    })
}

#[test]
fn next_frame_is_found_except_after_half_a_pair() {
    let wire = good_wire();
    let found = |parser: &mut FrameParser| !feed(parser, &wire).0.is_empty();
    // What follows depends on the state after the byte, not on how it was reached: every different
    // state is continued once.
    let mut seen = std::collections::HashSet::new();
    for before in every_state() {
        for byte in 0..=u8::MAX {
            let mut parser = before.clone();
            let is_frame = matches!(parser.push(byte), ParserEvent::Frame(_));
            if let ParserState::Body { length } | ParserState::Escaped { length } = parser.state {
                assert!(length < MAX_BODY, "{before:?} {byte:02X}");
            }
            assert!(!is_frame || parser.state == ParserState::Idle);
            let after = (parser.state, parser.body[1]);
            if !seen.insert(format!("{after:?}")) {
                continue;
            }
            let is_half_pair = matches!(parser.state, ParserState::Escaped { .. });
            let mut reset = parser.clone();
            reset.reset();
            assert!(found(&mut reset), "{before:?} {byte:02X}");
            assert!(found(&mut parser) || is_half_pair, "{before:?} {byte:02X}");
            assert!(found(&mut parser), "the second after {before:?} {byte:02X}");
        }
    }
}

/// Data with many bytes that need stuffing.
fn any_data() -> impl Strategy<Value = Vec<u8>> {
    vec(prop_oneof![3 => any::<u8>(), 1 => Just(DLE), 1 => Just(STX)], 0..=MAX_DATA)
}

proptest! {
    #[test]
    fn an_encoded_frame_is_parsed_to_the_same_content(opcode: u8, data in any_data()) {
        let wire = encode(opcode, &data);
        prop_assert!(wire.len() <= MAX_ENCODED);
        let mut padded = data;
        padded.resize(padded.len().next_multiple_of(2), 0);
        prop_assert_eq!(feed(&mut FrameParser::default(), &wire), (vec![(opcode, padded)], vec![]));
    }

    #[test]
    fn a_flipped_bit_never_passes_as_another_frame(
        data in any_data(), index: usize, bit in 0..8u8,
    ) {
        let wire = encode(0x00, &data);
        let mut bad = wire.clone();
        bad[index % wire.len()] ^= 1 << bit;
        let found = feed(&mut FrameParser::default(), &bad).0;
        prop_assert!(found.is_empty(), "{:?}", found);
    }
}

/// Expected outcome of a reference reply to a read (or to a write).
fn outcome(is_read: bool, reply: &[u8]) -> Outcome {
    let number = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap());
    match (number(&reply[..4]), reply.len()) {
        (0, 8) if is_read => Outcome::Answered(number(&reply[4..])),
        (0, 4) if !is_read => Outcome::Answered(0),
        (0, _) => Outcome::Disturbed,
        (code, _) => Outcome::Refused(AbortCode(code)),
    }
}

#[test]
fn public_frames_are_captures_that_replay_to_the_same_outcomes() {
    let port = |family: Family, opcodes: [u8; 2]| {
        let requests = reference().filter(|it| opcodes.contains(&it.opcode));
        let attempts = requests.flat_map(|request| {
            reference().filter(|it| it.opcode == 0).flat_map(move |reply| {
                let outcome = outcome(request.opcode == opcodes[0], &reply.data);
                let event = |kind, bytes| LineEvent { time: Nanos(0), kind, bytes };
                [
                    event(LineEventKind::Sent, request.wire.clone()),
                    event(LineEventKind::Received, reply.wire),
                    LineEvent::of_outcome(Nanos(0), outcome),
                ]
            })
        });
        let (device, events) = (String::new(), attempts.collect());
        CapturedPort { device, family, baud: 115_200, events }
    };
    let ports = vec![port(Family::Epos4, [0x60, 0x68]), port(Family::Epos2, [0x10, 0x11])];
    let file = to_bytes(&ports, "test", Nanos(0));
    assert_eq!(from_bytes(&file), Some(CaptureFile { ports: ports.clone(), is_whole: true }));
    let replayed = ports.iter().map(replay);
    for (found, least) in replayed.zip([400, 60]) {
        let LineReplay { attempts, skipped, differences } = found;
        assert!(attempts >= least && skipped == 0 && differences.is_empty(), "{differences:?}");
    }
    // A reply with a different recorded outcome is a difference.
    let mut wrong = ports[0].clone();
    wrong.events[2] = LineEvent::of_outcome(Nanos(0), Outcome::Timeout);
    assert_eq!(replay(&wrong).differences.len(), 1);
}
