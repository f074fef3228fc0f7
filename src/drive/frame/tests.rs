use proptest::collection::vec;
use proptest::prelude::*;

use super::*;

/// Wire bytes of worked frames, with what they say: opcode and data.
const WORKED: &[(&str, &str, u8, &str)] = &[
    // Reproduced from captures and from maxon's own example.
    (
        "read 0x30B0",
        "90 02 60 02 01 B0 30 00 2E 62",
        0x60,
        "01 B0 30 00",
    ),
    (
        "reply 0x9001",
        "90 02 00 04 00 00 00 00 01 90 90 00 00 9A 5C",
        0x00,
        "00 00 00 00 01 90 00 00",
    ),
    (
        "read controlword",
        "90 02 60 02 01 40 60 00 96 A7",
        0x60,
        "01 40 60 00",
    ),
    (
        "controlword 0x000F",
        "90 02 68 04 01 40 60 00 0F 00 00 00 B3 07",
        0x68,
        "01 40 60 00 0F 00 00 00",
    ),
    (
        "read statusword",
        "90 02 60 02 01 41 60 00 22 D1",
        0x60,
        "01 41 60 00",
    ),
    (
        "read mode display",
        "90 02 60 02 01 61 60 00 6C E6",
        0x60,
        "01 61 60 00",
    ),
    (
        "mode 1",
        "90 02 68 04 01 60 60 00 01 00 00 00 DA 67",
        0x68,
        "01 60 60 00 01 00 00 00",
    ),
    (
        "read 0x6081",
        "90 02 60 02 01 81 60 00 86 62",
        0x60,
        "01 81 60 00",
    ),
    (
        "read 0x6083",
        "90 02 60 02 01 83 60 00 EE 8F",
        0x60,
        "01 83 60 00",
    ),
    (
        "read 0x6084",
        "90 02 60 02 01 84 60 00 C3 DE",
        0x60,
        "01 84 60 00",
    ),
    (
        "0x6081 = 999",
        "90 02 68 04 01 81 60 00 E7 03 00 00 7D D9",
        0x68,
        "01 81 60 00 E7 03 00 00",
    ),
    (
        "0x6083 = 10000",
        "90 02 68 04 01 83 60 00 10 27 00 00 A6 CD",
        0x68,
        "01 83 60 00 10 27 00 00",
    ),
    (
        "0x6084 = 10000",
        "90 02 68 04 01 84 60 00 10 27 00 00 BE 0A",
        0x68,
        "01 84 60 00 10 27 00 00",
    ),
    (
        "read target",
        "90 02 60 02 01 7A 60 00 D4 E3",
        0x60,
        "01 7A 60 00",
    ),
    (
        "target 1000",
        "90 02 68 04 01 7A 60 00 E8 03 00 00 6E 6E",
        0x68,
        "01 7A 60 00 E8 03 00 00",
    ),
    (
        "clear history",
        "90 02 68 04 01 03 10 00 00 00 00 00 A1 08",
        0x68,
        "01 03 10 00 00 00 00 00",
    ),
    (
        "store all",
        "90 02 68 04 01 10 10 01 73 61 76 65 70 FC",
        0x68,
        "01 10 10 01 73 61 76 65",
    ),
    (
        "read position",
        "90 02 60 02 01 64 60 00 29 5A",
        0x60,
        "01 64 60 00",
    ),
    // Computed for the reference, nodes 1 and 2.
    (
        "read statusword N2",
        "90 02 60 02 02 41 60 00 72 88",
        0x60,
        "02 41 60 00",
    ),
    (
        "read position N2",
        "90 02 60 02 02 64 60 00 79 03",
        0x60,
        "02 64 60 00",
    ),
    (
        "read velocity",
        "90 02 60 02 01 6C 60 00 EA DF",
        0x60,
        "01 6C 60 00",
    ),
    (
        "read error code",
        "90 02 60 02 01 3F 60 00 0D 31",
        0x60,
        "01 3F 60 00",
    ),
    (
        "read current",
        "90 02 60 02 01 D1 30 02 2A 2B",
        0x60,
        "01 D1 30 02",
    ),
    (
        "read device type",
        "90 02 60 02 01 00 10 00 9D B7",
        0x60,
        "01 00 10 00",
    ),
    (
        "read vendor",
        "90 02 60 02 01 18 10 01 C8 1A",
        0x60,
        "01 18 10 01",
    ),
    (
        "controlword 0x0000",
        "90 02 68 04 01 40 60 00 00 00 00 00 82 2B",
        0x68,
        "01 40 60 00 00 00 00 00",
    ),
    (
        "controlword 0x0002",
        "90 02 68 04 01 40 60 00 02 00 00 00 E2 45",
        0x68,
        "01 40 60 00 02 00 00 00",
    ),
    (
        "controlword 0x0006",
        "90 02 68 04 01 40 60 00 06 00 00 00 22 99",
        0x68,
        "01 40 60 00 06 00 00 00",
    ),
    (
        "controlword 0x0007",
        "90 02 68 04 01 40 60 00 07 00 00 00 12 AE",
        0x68,
        "01 40 60 00 07 00 00 00",
    ),
    (
        "stuffed CRC, low",
        "90 02 68 04 02 40 60 00 07 00 00 00 90 90 76",
        0x68,
        "02 40 60 00 07 00 00 00",
    ),
    (
        "controlword 0x000F N2",
        "90 02 68 04 02 40 60 00 0F 00 00 00 31 DF",
        0x68,
        "02 40 60 00 0F 00 00 00",
    ),
    (
        "controlword 0x003F",
        "90 02 68 04 01 40 60 00 3F 00 00 00 16 C2",
        0x68,
        "01 40 60 00 3F 00 00 00",
    ),
    (
        "halt 0x010F",
        "90 02 68 04 01 40 60 00 0F 01 00 00 07 71",
        0x68,
        "01 40 60 00 0F 01 00 00",
    ),
    (
        "fault reset",
        "90 02 68 04 01 40 60 00 80 00 00 00 D8 10",
        0x68,
        "01 40 60 00 80 00 00 00",
    ),
    (
        "mode 8",
        "90 02 68 04 01 60 60 00 08 00 00 00 4B F9",
        0x68,
        "01 60 60 00 08 00 00 00",
    ),
    (
        "0x60C2:01 = 0",
        "90 02 68 04 01 C2 60 01 00 00 00 00 05 1C",
        0x68,
        "01 C2 60 01 00 00 00 00",
    ),
    (
        "target 0",
        "90 02 68 04 01 7A 60 00 00 00 00 00 22 FC",
        0x68,
        "01 7A 60 00 00 00 00 00",
    ),
    (
        "target -1",
        "90 02 68 04 01 7A 60 00 FF FF FF FF ED 65",
        0x68,
        "01 7A 60 00 FF FF FF FF",
    ),
    (
        "stuffed data",
        "90 02 68 04 01 7A 60 00 90 90 00 00 00 1B 84",
        0x68,
        "01 7A 60 00 90 00 00 00",
    ),
    (
        "stuffed CRC, high",
        "90 02 68 04 01 7A 60 00 6C F0 FF FF 6A 90 90",
        0x68,
        "01 7A 60 00 6C F0 FF FF",
    ),
    (
        "all data stuffed",
        "90 02 68 04 01 7A 60 00 90 90 90 90 90 90 90 90 D6 D9",
        0x68,
        "01 7A 60 00 90 90 90 90",
    ),
    (
        "write ok",
        "90 02 00 02 00 00 00 00 40 8B",
        0x00,
        "00 00 00 00",
    ),
    (
        "statusword 0x0237",
        "90 02 00 04 00 00 00 00 37 02 00 00 68 00",
        0x00,
        "00 00 00 00 37 02 00 00",
    ),
    (
        "position -12345",
        "90 02 00 04 00 00 00 00 C7 CF FF FF 17 74",
        0x00,
        "00 00 00 00 C7 CF FF FF",
    ),
    (
        "device type",
        "90 02 00 04 00 00 00 00 92 01 02 00 9A ED",
        0x00,
        "00 00 00 00 92 01 02 00",
    ),
    (
        "no such object, short",
        "90 02 00 02 00 00 02 06 A4 01",
        0x00,
        "00 00 02 06",
    ),
    (
        "no such object, long",
        "90 02 00 04 00 00 02 06 00 00 00 00 57 64",
        0x00,
        "00 00 02 06 00 00 00 00",
    ),
    (
        "value range",
        "90 02 00 02 30 00 09 06 6A 75",
        0x00,
        "30 00 09 06",
    ),
    (
        "wrong state",
        "90 02 00 02 22 00 00 08 4F EA",
        0x00,
        "22 00 00 08",
    ),
    (
        "wrong CRC",
        "90 02 00 02 04 00 04 05 F1 E8",
        0x00,
        "04 00 04 05",
    ),
    (
        "illegal command",
        "90 02 00 02 BF FF 00 0F 13 02",
        0x00,
        "BF FF 00 0F",
    ),
    (
        "reset node 1",
        "90 02 70 02 01 00 81 00 5F 20",
        0x70,
        "01 00 81 00",
    ),
    (
        "start all nodes",
        "90 02 70 02 00 00 01 00 E7 86",
        0x70,
        "00 00 01 00",
    ),
    (
        "segmented read",
        "90 02 81 02 01 08 10 00 03 A3",
        0x81,
        "01 08 10 00",
    ),
    // EPOS2 over USB: the same frame, other opcodes and another order of parameters.
    (
        "EPOS2 read statusword",
        "90 02 10 02 41 60 00 01 64 CF",
        0x10,
        "41 60 00 01",
    ),
    (
        "EPOS2 read position",
        "90 02 10 02 64 60 00 01 52 A2",
        0x10,
        "64 60 00 01",
    ),
    (
        "EPOS2 controlword",
        "90 02 11 04 40 60 00 01 0F 00 00 00 2D 2C",
        0x11,
        "40 60 00 01 0F 00 00 00",
    ),
    (
        "EPOS2 mode -1",
        "90 02 11 04 60 60 00 01 FF 00 00 00 89 A1",
        0x11,
        "60 60 00 01 FF 00 00 00",
    ),
    (
        "EPOS2 target N1",
        "90 02 11 04 62 20 00 01 E8 03 00 00 95 6A",
        0x11,
        "62 20 00 01 E8 03 00 00",
    ),
    (
        "EPOS2 target N2",
        "90 02 11 04 62 20 00 02 E8 03 00 00 75 A4",
        0x11,
        "62 20 00 02 E8 03 00 00",
    ),
];

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace()
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

fn encode(opcode: u8, data: &[u8]) -> Vec<u8> {
    Encoder::default()
        .encode(Frame { opcode, data })
        .unwrap()
        .to_vec()
}

/// The frames and the damage that a parser finds in some bytes.
fn feed(parser: &mut Parser, wire: &[u8]) -> (Vec<(u8, Vec<u8>)>, Vec<Damage>) {
    let (mut frames, mut damage) = (Vec::new(), Vec::new());
    for &byte in wire {
        match parser.push(byte) {
            Parsed::Nothing => {}
            Parsed::Frame(frame) => frames.push((frame.opcode, frame.data.to_vec())),
            Parsed::Damaged(kind) => damage.push(kind),
        }
    }
    (frames, damage)
}

#[test]
fn every_worked_frame_is_encoded_byte_for_byte() {
    for (what, wire, opcode, data) in WORKED {
        assert_eq!(encode(*opcode, &bytes(data)), bytes(wire), "{what}");
    }
}

#[test]
fn every_worked_frame_is_understood() {
    for (what, wire, opcode, data) in WORKED {
        let found = feed(&mut Parser::default(), &bytes(wire));
        assert_eq!(found, (vec![(*opcode, bytes(data))], vec![]), "{what}");
    }
}

#[test]
fn data_beyond_the_longest_frame_is_refused() {
    assert_eq!(encode(1, &[DLE; MAX_DATA]).len(), 2 + 2 * MAX_DATA + 4);
    assert_eq!(
        Encoder::default().encode(Frame {
            opcode: 1,
            data: &[0; 287]
        }),
        Err(TooLong { bytes: 287 })
    );
}

#[test]
fn an_impossible_length_is_lost_sync_at_once() {
    let (frames, damage) = feed(&mut Parser::default(), &bytes("90 02 00 91"));
    assert_eq!((frames.len(), damage), (0, vec![Damage::LostSync]));
    // A length of 0x90 words arrives doubled.
    let (frames, damage) = feed(&mut Parser::default(), &bytes("90 02 00 90 90"));
    assert_eq!((frames.len(), damage), (0, vec![Damage::LostSync]));
}

#[test]
fn a_wrong_crc_is_never_a_frame() {
    for (what, wire, ..) in WORKED {
        let mut wire = bytes(wire);
        *wire.last_mut().unwrap() ^= 0x01;
        assert_eq!(feed(&mut Parser::default(), &wire).0, vec![], "{what}");
    }
}

#[test]
fn garbage_between_frames_is_reported_once() {
    let wire = [bytes("0A 0D 90 90 55 90"), bytes(WORKED[0].1)].concat();
    let (frames, damage) = feed(&mut Parser::default(), &wire);
    assert_eq!((frames.len(), damage), (1, vec![Damage::LostSync]));
}

#[test]
fn a_new_start_inside_a_frame_drops_the_cut_one() {
    let wire = [bytes("90 02 60 02 01 41"), bytes(WORKED[1].1)].concat();
    let (frames, damage) = feed(&mut Parser::default(), &wire);
    assert_eq!(
        (frames, damage),
        (vec![(0x00, bytes(WORKED[1].3))], vec![Damage::LostSync])
    );
}

#[test]
fn a_frame_cut_inside_a_doubled_byte_takes_the_next_with_it_unless_reset() {
    let cut = bytes("90 02 00 04 00 00 00 00 01 90");
    let good = bytes("90 02 00 02 00 00 00 00 40 8B");

    let mut parser = Parser::default();
    feed(&mut parser, &cut);
    assert_eq!(
        feed(&mut parser, &good).0,
        vec![],
        "the protocol cannot save this one"
    );

    let mut parser = Parser::default();
    feed(&mut parser, &cut);
    parser.reset();
    assert_eq!(feed(&mut parser, &good).0, vec![(0x00, vec![0; 4])]);
}

/// Data with many bytes that need stuffing.
fn data() -> impl Strategy<Value = Vec<u8>> {
    vec(
        prop_oneof![3 => any::<u8>(), 1 => Just(DLE), 1 => Just(STX)],
        0..=MAX_DATA,
    )
}

/// A way to spoil the bytes of a frame; the numbers pick the place.
#[derive(Debug, Clone)]
enum Spoil {
    Flip(usize, u8),
    Drop(usize),
    Duplicate(usize),
    Truncate(usize),
    Garbage(Vec<u8>),
}

fn spoil() -> impl Strategy<Value = Spoil> {
    prop_oneof![
        (any::<usize>(), 0..8u8).prop_map(|(place, bit)| Spoil::Flip(place, 1 << bit)),
        any::<usize>().prop_map(Spoil::Drop),
        any::<usize>().prop_map(Spoil::Duplicate),
        any::<usize>().prop_map(Spoil::Truncate),
        vec(any::<u8>(), 1..40).prop_map(Spoil::Garbage),
    ]
}

impl Spoil {
    fn apply(&self, wire: &mut Vec<u8>) {
        let length = wire.len();
        match self {
            Self::Flip(place, mask) => wire[place % length] ^= mask,
            Self::Drop(place) => drop(wire.remove(place % length)),
            Self::Duplicate(place) => wire.insert(place % length, wire[place % length]),
            Self::Truncate(place) => wire.truncate(place % length),
            Self::Garbage(bytes) => drop(wire.splice(0..0, bytes.iter().copied())),
        }
    }
}

proptest! {
    #[test]
    fn what_is_encoded_is_decoded(opcode: u8, data in data()) {
        let wire = encode(opcode, &data);
        prop_assert!(wire.len() <= MAX_ENCODED);
        let mut padded = data;
        padded.resize(padded.len().next_multiple_of(2), 0);
        prop_assert_eq!(feed(&mut Parser::default(), &wire), (vec![(opcode, padded)], vec![]));
    }

    #[test]
    fn a_good_frame_is_found_after_any_damage_and_a_reset(opcode: u8, data in data(), spoil in spoil()) {
        let good = encode(opcode, &data);
        let mut bad = good.clone();
        spoil.apply(&mut bad);
        let mut parser = Parser::default();
        feed(&mut parser, &bad);
        parser.reset();
        prop_assert_eq!(feed(&mut parser, &good).0.len(), 1);
    }

    #[test]
    fn without_a_reset_only_a_cut_pair_loses_the_frame_after_a_cut_one(data in data(), keep: usize) {
        let wire = encode(0x00, &data);
        let mut parser = Parser::default();
        feed(&mut parser, &wire[..keep % wire.len()]);
        let inside_a_pair = matches!(parser.state, parser::State::Escaped { .. });
        let found = feed(&mut parser, &bytes(WORKED[0].1)).0;
        prop_assert_eq!(found.len(), usize::from(!inside_a_pair));
    }

    #[test]
    fn a_flipped_bit_never_passes_as_another_frame(data in data(), place: usize, bit in 0..8u8) {
        let wire = encode(0x00, &data);
        let mut bad = wire.clone();
        Spoil::Flip(place, 1 << bit).apply(&mut bad);
        let found = feed(&mut Parser::default(), &bad).0;
        prop_assert!(found.is_empty(), "{:?}", found);
    }

    #[test]
    fn random_bytes_never_panic_and_do_not_stop_the_parser(noise in vec(any::<u8>(), 0..2000)) {
        let mut parser = Parser::default();
        feed(&mut parser, &noise);
        parser.reset();
        prop_assert_eq!(feed(&mut parser, &bytes(WORKED[0].1)).0.len(), 1);
    }
}
