//! All frames with one or two bytes of data, and those with three (in the gate every 16th): the
//! controller's encoder and parser against those of the emulator, which share no code with them.

use i2ris::drive::serial_frame::{FrameEncoder, FrameParser, ParserEvent, SerialFrame};
use i2ris_simulation::frame::{self, Incoming};

/// Both ends of a line.
#[derive(Default)]
struct Ends {
    encoder: FrameEncoder,
    parser: FrameParser,
    emulated: frame::Parser,
}

impl Ends {
    fn check(&mut self, opcode: u8, data: &[u8]) {
        let wire = self.encoder.encode(SerialFrame { opcode, data }).unwrap();
        // Frames hold whole words.
        let mut padded = data.to_vec();
        padded.resize(data.len().next_multiple_of(2), 0);
        assert_eq!(wire, frame::encode(opcode, &padded), "{data:02X?}");
        let (last, head) = wire.split_last().unwrap();
        for byte in head {
            assert_eq!(self.parser.push(*byte), ParserEvent::None, "{data:02X?}");
            assert_eq!(self.emulated.push(*byte), None, "{data:02X?}");
        }
        let sent = SerialFrame { opcode, data: &padded };
        assert_eq!(self.parser.push(*last), ParserEvent::Frame(sent));
        match self.emulated.push(*last) {
            Some(Incoming::Request(got)) => assert_eq!((got.opcode, got.data), (opcode, padded)),
            other => panic!("{data:02X?}: {other:?}"),
        }
    }
}

#[test]
fn driver_and_emulator_agree_on_short_frames() {
    // As of other properties, .ci/nightly checks all: 16 million.
    let step = if std::env::var_os("PROPTEST_CASES").is_some() { 1 } else { 16 };
    let mut ends = Ends::default();
    let bytes = || 0..=u8::MAX;
    for a in bytes() {
        ends.check(0x60, &[a]);
        for b in bytes() {
            ends.check(0x68, &[a, b]);
            let skipped = usize::from(a ^ b) % step;
            bytes().skip(skipped).step_by(step).for_each(|c| ends.check(0x00, &[a, b, c]));
        }
    }
}
