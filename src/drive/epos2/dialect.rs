//! Requests of the EPOS2: opcodes of the first EPOS, and index, subindex, node in this order.
//!
//! Sources: maxon's EPOS Communication Guide (2006) for RS232; for USB the public driver of the
//! University of Osnabrueck, which sends the same requests in V2 frames.

use super::segmented::SegmentedRead;
use crate::drive::dialect::{Dialect, LongRead, READ_REPLY_WORDS, WRITE_REPLY_WORDS};
use crate::drive::object::{Address, Setting};
use crate::drive::request::Request;

const READ_OBJECT: u8 = 0x10;
const WRITE_OBJECT: u8 = 0x11;

/// The dialect of the EPOS2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Epos2Dialect;

impl Dialect for Epos2Dialect {
    fn read(&self, node: u8, object: Address) -> Request {
        Request::new(READ_OBJECT, selector(node, object), READ_REPLY_WORDS)
    }

    fn write(&self, node: u8, setting: Setting) -> Request {
        let [a, b, c, d] = selector(node, setting.object);
        let [e, f, g, h] = setting.raw.to_le_bytes();
        Request::new(WRITE_OBJECT, [a, b, c, d, e, f, g, h], WRITE_REPLY_WORDS)
    }

    fn read_long(&self, node: u8, object: Address) -> Box<dyn LongRead> {
        Box::new(SegmentedRead::new(node, object))
    }
}

/// Index, subindex and node, as every object request starts.
pub(super) const fn selector(node: u8, object: Address) -> [u8; 4] {
    let [low, high] = object.index.to_le_bytes();
    [low, high, object.subindex, node]
}

#[cfg(test)]
mod tests {
    use super::super::object;
    use super::*;
    use crate::drive::frame::{Encoder, Frame};
    use crate::drive::object::{CONTROLWORD, MODE, POSITION, STATUSWORD};

    #[test]
    fn requests_have_the_layout_of_the_worked_frames() {
        let read = Epos2Dialect.read(2, object::CURRENT.address());
        assert_eq!(
            read.frame(),
            Frame {
                opcode: 0x10,
                data: &[0x78, 0x60, 0x00, 0x02]
            }
        );
        let write = Epos2Dialect.write(1, object::TARGET.set(1000));
        assert_eq!(
            write.frame(),
            Frame {
                opcode: 0x11,
                data: &[0x62, 0x20, 0x00, 0x01, 0xE8, 0x03, 0, 0]
            }
        );
    }

    #[test]
    fn frames_on_usb_are_those_of_the_reference() {
        let mut encoder = Encoder::default();
        for (request, wire) in [
            (
                Epos2Dialect.read(1, STATUSWORD.address()),
                "90 02 10 02 41 60 00 01 64 CF",
            ),
            (
                Epos2Dialect.read(1, POSITION.address()),
                "90 02 10 02 64 60 00 01 52 A2",
            ),
            (
                Epos2Dialect.write(1, CONTROLWORD.set(0x000F)),
                "90 02 11 04 40 60 00 01 0F 00 00 00 2D 2C",
            ),
            (
                Epos2Dialect.write(1, MODE.set(-1)),
                "90 02 11 04 60 60 00 01 FF 00 00 00 89 A1",
            ),
            (
                Epos2Dialect.write(1, object::TARGET.set(1000)),
                "90 02 11 04 62 20 00 01 E8 03 00 00 95 6A",
            ),
            (
                Epos2Dialect.write(2, object::TARGET.set(1000)),
                "90 02 11 04 62 20 00 02 E8 03 00 00 75 A4",
            ),
        ] {
            let bytes: Vec<String> = encoder
                .encode(request.frame())
                .unwrap()
                .iter()
                .map(|byte| format!("{byte:02X}"))
                .collect();
            assert_eq!(bytes.join(" "), wire);
        }
    }
}
