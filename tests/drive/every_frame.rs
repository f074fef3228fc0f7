//! All frames with one, two or three bytes of data: the controller's encoder and parser against
//! those of the emulator, which share no code with them.

use std::thread;

use i2ris::drive::serial_frame::{FrameEncoder, SerialFrame};
use i2ris::drive::serial_frame_parser::{FrameParser, ParserEvent};
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
fn driver_and_emulator_agree_on_every_short_frame() {
    let work = |first: std::ops::Range<u16>| {
        let mut ends = Ends::default();
        for a in first.map(|a| a as u8) {
            ends.check(0x60, &[a]);
            for b in 0..=u8::MAX {
                ends.check(0x68, &[a, b]);
                for c in 0..=u8::MAX {
                    ends.check(0x00, &[a, b, c]);
                }
            }
        }
    };
    thread::scope(|scope| {
        scope.spawn(move || work(0..128));
        scope.spawn(move || work(128..256));
    });
}
