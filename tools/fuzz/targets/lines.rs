//! Bytes of a serial line: the frame parser, and everything that reads a reply. A frame after the
//! bytes must be found after a reset.
#![no_main]

use i2ris::config::{Family, PortConfig};
use i2ris::drive::family_selection::family_of_port;
use i2ris::drive::serial_frame::{FrameEncoder, SerialFrame};
use i2ris::drive::serial_frame::{FrameParser, ParserEvent};
use i2ris::drive::object;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let command_sets = [Family::Epos4, Family::Epos2].map(|family| {
        let port = PortConfig { family, ..PortConfig::new("/dev/null".into(), Vec::new()) };
        family_of_port(&port).command_set()
    });
    let read = |frame: SerialFrame<'_>| {
        for commands in command_sets {
            let object = object::STATUSWORD.address();
            let _ = (commands.read_reply(frame, object), commands.write_reply(frame));
            let mut segmented = commands.read_segmented(1, object::DEVICE_NAME);
            let _ = segmented.take_reply(frame);
        }
    };
    let mut parser = FrameParser::default();
    for byte in bytes {
        if let ParserEvent::Frame(frame) = parser.push(*byte) {
            read(frame);
        }
    }
    // Without the CRC, which random bytes hardly ever match.
    if let Some((&opcode, data)) = bytes.split_first() {
        read(SerialFrame { opcode, data });
    }
    parser.reset();
    let frame = SerialFrame { opcode: 0, data: &[1, 2, 3, 4] };
    let mut encoder = FrameEncoder::default();
    let wire = encoder.encode(frame).expect("eight bytes fit a frame");
    let found = wire.iter().filter(|byte| parser.push(**byte) == ParserEvent::Frame(frame)).count();
    assert_eq!(found, 1, "a good frame was lost");
});
