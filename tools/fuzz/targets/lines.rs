//! Bytes of a serial line: the parser of frames, and everything that reads a reply. A frame behind
//! the bytes must be found after a reset.
#![no_main]

use i2ris::config::{Family, PortConfig};
use i2ris::drive::frame::{Encoder, Frame, Parsed, Parser};
use i2ris::drive::{family, handshake, object};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let dialects = [Family::Epos4, Family::Epos2].map(|family| {
        let port = PortConfig {
            family,
            ..PortConfig::new("/dev/null".into(), Vec::new())
        };
        family::of_port(&port).dialect()
    });
    let read = |frame: Frame<'_>| {
        for dialect in dialects {
            let _ = (dialect.read_reply(frame), dialect.write_reply(frame));
            let _ = dialect.read_long(1, object::DEVICE_NAME).take(frame);
        }
    };
    let mut parser = Parser::default();
    for byte in bytes {
        if let Parsed::Frame(frame) = parser.push(*byte) {
            read(frame);
        }
    }
    // Past the checksum, which random bytes hardly ever get right.
    if let Some((opcode, data)) = bytes.split_first() {
        read(Frame {
            opcode: *opcode,
            data,
        });
        let _ = handshake::open(*opcode, data);
    }
    parser.reset();
    let frame = Frame {
        opcode: 0,
        data: &[1, 2, 3, 4],
    };
    let found = Encoder::default().encode(frame).is_ok_and(|sent| {
        sent.iter()
            .filter(|byte| matches!(parser.push(**byte), Parsed::Frame(found) if found == frame))
            .count()
            == 1
    });
    assert!(found, "a good frame was lost");
});
