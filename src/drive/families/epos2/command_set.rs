//! Requests of the EPOS2: opcodes of the first EPOS, and index, subindex, node.
//!
//! The control byte of a segment holds its length (bits 0 to 5), the toggle bit (6) and whether
//! more segments follow (7). The reply that opens a segmented read has an error code; it is unknown
//! whether it also has the first segment, so both are accepted.
//!
//! Sources: maxon's EPOS Communication Guide (2006) for RS232; for USB the public driver of the
//! University of Osnabrueck, which sends the same requests in V2 frames.

use crate::drive::command_set::{CommandSet, Segment};

/// Words of data in the longest reply: error code, control byte, 63 bytes.
const REPLY_WORDS: u8 = 34;

const LENGTH: u8 = 0x3F;
const TOGGLE: u8 = 1 << 6;
const MORE: u8 = 1 << 7;

/// The command set of the EPOS2.
pub(super) const COMMANDS: &CommandSet = &CommandSet {
    read: 0x10,
    write: 0x11,
    first_segment: 0x12,
    next_segment: 0x14,
    node_first: false,
    segment_words: [REPLY_WORDS; 2],
    toggle: TOGGLE,
    first: |data| if data.is_empty() { Some(Segment::default()) } else { segment(data) },
    next: segment,
};

fn segment(data: &[u8]) -> Option<Segment<'_>> {
    let (&control, data) = data.split_first()?;
    Some(Segment {
        data: data.get(..usize::from(control & LENGTH))?,
        toggle: Some(control & TOGGLE != 0),
        is_last: control & MORE == 0,
        ..Segment::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::command_set::{REPLY_OPCODE, ReplyError};
    use crate::drive::object::{Address, CONTROLWORD, MODE, Object, POSITION, STATUSWORD};
    use crate::drive::serial_frame::{FrameEncoder, SerialFrame};

    const TARGET: Object<i32> = Object::of(0x2062, 0);

    const FULL_SERIAL_NUMBER: Address = Address::of(0x2004, 0);

    fn reply(data: &[u8]) -> SerialFrame<'_> {
        SerialFrame { opcode: REPLY_OPCODE, data }
    }

    #[test]
    fn frames_on_usb_match_the_reference() {
        let mut encoder = FrameEncoder::default();
        let commands = COMMANDS;
        for (request, wire) in [
            (commands.read(1, STATUSWORD.address()), "90 02 10 02 41 60 00 01 64 CF"),
            (commands.read(1, POSITION.address()), "90 02 10 02 64 60 00 01 52 A2"),
            (
                commands.write(1, CONTROLWORD.set(0x000F)),
                "90 02 11 04 40 60 00 01 0F 00 00 00 2D 2C",
            ),
            (commands.write(1, MODE.set(-1)), "90 02 11 04 60 60 00 01 FF 00 00 00 89 A1"),
            (commands.write(1, TARGET.set(1000)), "90 02 11 04 62 20 00 01 E8 03 00 00 95 6A"),
            (commands.write(2, TARGET.set(1000)), "90 02 11 04 62 20 00 02 E8 03 00 00 75 A4"),
        ] {
            let bytes = encoder.encode(request.frame()).unwrap();
            let hex: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
            assert_eq!(hex.join(" "), wire);
        }
    }

    /// One word instead of two; in a reply with two words, the upper word is 0x8090, as public code
    /// has read it.
    #[test]
    fn short_value_is_read_from_one_or_two_words() {
        for data in [&[0, 0, 0, 0, 0x37, 0x02][..], &[0, 0, 0, 0, 0x37, 0x02, 0x90, 0x80]] {
            let value = COMMANDS.read_reply(reply(data), STATUSWORD.address());
            assert_eq!(value, Ok(0x0237));
        }
        let short = COMMANDS.read_reply(reply(&[0, 0, 0, 0, 6, 0]), POSITION.address());
        assert_eq!(short, Err(ReplyError::Mismatch));
    }

    #[test]
    fn segments_alternate_their_toggle_bit() {
        let mut read = COMMANDS.read_segmented(1, FULL_SERIAL_NUMBER);
        for (opcode, request, answer, is_complete) in [
            (0x12, &[0x04, 0x20, 0, 1][..], &[0; 4][..], false),
            (0x14, &[0, 0], &[0, 0, 0, 0, 0x85, 1, 2, 3, 4, 5], false),
            (0x14, &[0x40, 0], &[0, 0, 0, 0, 0x43, 6, 7, 8], true),
        ] {
            let data = request;
            assert_eq!(read.request().frame(), SerialFrame { opcode, data });
            assert_eq!(read.take_reply(reply(answer)), Ok(is_complete));
        }
        assert_eq!(read.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn the_first_segment_may_come_at_once() {
        let mut read = COMMANDS.read_segmented(1, FULL_SERIAL_NUMBER);
        assert_eq!(read.take_reply(reply(&[0, 0, 0, 0, 0x03, 1, 2, 3])), Ok(true));
        assert_eq!(read.bytes(), [1, 2, 3]);
    }

    #[test]
    fn a_repeated_or_short_segment_is_a_mismatch() {
        let mut read = COMMANDS.read_segmented(1, FULL_SERIAL_NUMBER);
        read.take_reply(reply(&[0; 4])).unwrap();
        read.take_reply(reply(&[0, 0, 0, 0, 0x81, 1])).unwrap();
        for control in [0x81, 0x49] {
            let outcome = read.take_reply(reply(&[0, 0, 0, 0, control, 1]));
            assert_eq!(outcome, Err(ReplyError::Mismatch));
        }
    }
}
