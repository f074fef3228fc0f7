//! Requests of the EPOS4: node, index, subindex.
//!
//! Source: maxon's EPOS4 Communication Guide (2019-11).

use crate::drive::command_set::{CommandSet, Segment};

/// Words of data in the longest reply to the first request: error code, total length, length, 255
/// bytes.
const FIRST_REPLY_WORDS: u8 = 132;

/// Words of data in the longest reply to the others: error code, length, control, 255 bytes.
const NEXT_REPLY_WORDS: u8 = 131;

const TOGGLE: u8 = 1 << 0;
const LAST: u8 = 1 << 1;

/// The command set of the EPOS4.
pub(super) const COMMANDS: &CommandSet = &CommandSet {
    read: 0x60,
    write: 0x68,
    first_segment: 0x81,
    next_segment: 0x62,
    node_first: true,
    segment_words: [FIRST_REPLY_WORDS, NEXT_REPLY_WORDS],
    toggle: TOGGLE,
    first: |data| {
        let (total, data) = data.split_first_chunk::<4>()?;
        let (&length, data) = data.split_first()?;
        Some(Segment {
            data: data.get(..usize::from(length))?,
            total: Some(usize::try_from(u32::from_le_bytes(*total)).unwrap_or(usize::MAX)),
            ..Segment::default()
        })
    },
    next: |data| {
        let &[length, control, ref data @ ..] = data else { return None };
        Some(Segment {
            data: data.get(..usize::from(length))?,
            toggle: Some(control & TOGGLE != 0),
            is_last: control & LAST != 0,
            ..Segment::default()
        })
    },
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::abort_code::AbortCode;
    use crate::drive::command_set::{DriveRequest, REPLY_OPCODE, ReplyError};
    use crate::drive::object::{Address, DEVICE_NAME, POSITION, TARGET};
    use crate::drive::serial_frame::SerialFrame;

    fn reply(data: &[u8]) -> SerialFrame<'_> {
        SerialFrame { opcode: REPLY_OPCODE, data }
    }

    fn request_bytes(request: DriveRequest) -> Vec<u8> {
        let frame = request.frame();
        [&[frame.opcode], frame.data].concat()
    }

    #[test]
    fn requests_have_the_layout_of_the_reference() {
        let read = COMMANDS.read(1, POSITION.address());
        assert_eq!(request_bytes(read), [0x60, 0x01, 0x64, 0x60, 0x00]);
        let write = COMMANDS.write(2, TARGET.set(-3988));
        assert_eq!(request_bytes(write), [0x68, 0x02, 0x7A, 0x60, 0x00, 0x6C, 0xF0, 0xFF, 0xFF]);
    }

    #[test]
    fn a_serial_number_comes_in_one_reply() {
        let full_serial_number = Address::of(0x2100, 1);
        let mut read = COMMANDS.read_segmented(1, full_serial_number);
        assert_eq!(request_bytes(read.request()), [0x81, 0x01, 0x00, 0x21, 0x01]);
        // Seventeen bytes, padded to whole words.
        let data = [0, 0, 0, 0, 8, 0, 0, 0, 8, 1, 2, 3, 4, 5, 6, 7, 8, 0];
        assert_eq!(read.take_reply(reply(&data)), Ok(true));
        assert_eq!(read.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn segments_alternate_their_toggle_bit() {
        let mut read = COMMANDS.read_segmented(1, DEVICE_NAME);
        let first = [0, 0, 0, 0, 5, 0, 0, 0, 1, b'E'];
        assert_eq!(read.take_reply(reply(&first)), Ok(false));
        assert_eq!(request_bytes(read.request()), [0x62, 0, 0]);
        let second = [0, 0, 0, 0, 2, 0, b'P', b'O'];
        assert_eq!(read.take_reply(reply(&second)), Ok(false));
        assert_eq!(request_bytes(read.request()), [0x62, 1, 0]);
        let repeated = read.take_reply(reply(&second));
        assert_eq!(repeated, Err(ReplyError::Mismatch), "the toggle bit did not change");
        let third = [0, 0, 0, 0, 2, 3, b'S', b'4'];
        assert_eq!(read.take_reply(reply(&third)), Ok(true));
        assert_eq!(read.bytes(), b"EPOS4");
    }

    #[test]
    fn a_refusal_is_returned_and_nonsense_is_a_mismatch() {
        for (data, error) in [
            (&[0, 0, 2, 6][..], ReplyError::Refused(AbortCode(0x0602_0000))),
            (&[0; 4], ReplyError::Mismatch),
            (&[0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0], ReplyError::Mismatch),
            (&[0, 0, 0, 0, 1, 0, 0, 0, 9, 1], ReplyError::Mismatch),
        ] {
            let mut read = COMMANDS.read_segmented(1, DEVICE_NAME);
            assert_eq!(read.take_reply(reply(data)), Err(error), "{data:?}");
        }
    }
}
