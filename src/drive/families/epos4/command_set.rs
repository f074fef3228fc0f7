//! Requests of the EPOS4: node, index, subindex.
//!
//! Source: maxon's EPOS4 Communication Guide (2019-11).

use crate::drive::command_set::{
    CommandSet, DriveRequest, MAX_SEGMENTED, ReplyError, SegmentedRead, after_error_code,
};
use crate::drive::object::Address;
use crate::drive::serial_frame::SerialFrame;

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
    segmented: |node, object| Box::new(Epos4SegmentedRead::new(node, object)),
};

/// A segmented read in progress.
#[derive(Debug)]
pub(super) struct Epos4SegmentedRead {
    node: u8,
    object: Address,
    bytes: Vec<u8>,
    state: SegmentState,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SegmentState {
    /// The transfer is not opened yet.
    First,
    /// Opened; the next segment has this toggle bit.
    Next { total: usize, toggle: u8 },
}

impl Epos4SegmentedRead {
    pub(super) fn new(node: u8, object: Address) -> Self {
        Self { node, object, bytes: Vec::new(), state: SegmentState::First }
    }

    fn take_first(&mut self, rest: &[u8]) -> Result<bool, ReplyError> {
        let (total, rest) = rest.split_first_chunk::<4>().ok_or(ReplyError::Mismatch)?;
        let (&length, data) = rest.split_first().ok_or(ReplyError::Mismatch)?;
        let total = usize::try_from(u32::from_le_bytes(*total)).unwrap_or(usize::MAX);
        if total > MAX_SEGMENTED {
            return Err(ReplyError::Mismatch);
        }
        self.state = SegmentState::Next { total, toggle: 0 };
        self.append(length, data, total)?;
        Ok(self.bytes.len() == total)
    }

    fn take_next(&mut self, rest: &[u8], total: usize, toggle: u8) -> Result<bool, ReplyError> {
        let &[length, control, ref data @ ..] = rest else {
            return Err(ReplyError::Mismatch);
        };
        if control & TOGGLE != toggle {
            return Err(ReplyError::Mismatch);
        }
        self.append(length, data, total)?;
        self.state = SegmentState::Next { total, toggle: toggle ^ TOGGLE };
        match (control & LAST != 0, self.bytes.len() == total) {
            (_, true) => Ok(true),
            (false, false) => Ok(false),
            (true, false) => Err(ReplyError::Mismatch),
        }
    }

    fn append(&mut self, length: u8, data: &[u8], total: usize) -> Result<(), ReplyError> {
        let segment = data.get(..usize::from(length)).ok_or(ReplyError::Mismatch)?;
        if self.bytes.len() + segment.len() > total {
            return Err(ReplyError::Mismatch);
        }
        self.bytes.extend_from_slice(segment);
        Ok(())
    }
}

impl SegmentedRead for Epos4SegmentedRead {
    fn request(&self) -> DriveRequest {
        match self.state {
            SegmentState::First => DriveRequest::new(
                COMMANDS.first_segment,
                COMMANDS.selector(self.node, self.object),
                FIRST_REPLY_WORDS,
            ),
            SegmentState::Next { toggle, .. } => {
                DriveRequest::new(COMMANDS.next_segment, [toggle, 0], NEXT_REPLY_WORDS)
            }
        }
    }

    fn take_reply(&mut self, reply: SerialFrame<'_>) -> Result<bool, ReplyError> {
        let rest = after_error_code(reply)?;
        match self.state {
            SegmentState::First => self.take_first(rest),
            SegmentState::Next { total, toggle } => self.take_next(rest, total, toggle),
        }
    }

    fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::abort_code::AbortCode;
    use crate::drive::command_set::REPLY_OPCODE;
    use crate::drive::object::{DEVICE_NAME, POSITION, TARGET};

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
    fn values_follow_an_error_code_of_zero() {
        let data = [0, 0, 0, 0, 0xC7, 0xCF, 0xFF, 0xFF];
        let value = COMMANDS.read_reply(reply(&data), POSITION.address());
        assert_eq!(value, Ok(-12345_i32 as u32));
        assert_eq!(COMMANDS.write_reply(reply(&[0; 4])), Ok(()));
    }

    #[test]
    fn short_and_long_refusals_are_accepted() {
        let refused = ReplyError::Refused(AbortCode(0x0602_0000));
        for data in [&[0, 0, 2, 6][..], &[0, 0, 2, 6, 0, 0, 0, 0]] {
            let position = POSITION.address();
            assert_eq!(COMMANDS.read_reply(reply(data), position), Err(refused));
            assert_eq!(COMMANDS.write_reply(reply(data)), Err(refused));
        }
    }

    #[test]
    fn a_reply_to_another_kind_of_request_is_a_mismatch() {
        let echo = SerialFrame { opcode: 0x60, data: &[0; 8] };
        for frame in [reply(&[0; 4]), echo, reply(&[1, 0, 0, 0, 0, 0, 0, 0, 0, 0])] {
            let value = COMMANDS.read_reply(frame, POSITION.address());
            assert_eq!(value, Err(ReplyError::Mismatch));
        }
        for frame in [reply(&[0; 8]), reply(&[])] {
            assert_eq!(COMMANDS.write_reply(frame), Err(ReplyError::Mismatch));
        }
    }

    #[test]
    fn a_serial_number_comes_in_one_reply() {
        let full_serial_number = Address::of(0x2100, 1);
        let mut read = Epos4SegmentedRead::new(1, full_serial_number);
        assert_eq!(request_bytes(read.request()), [0x81, 0x01, 0x00, 0x21, 0x01]);
        // Seventeen bytes, padded to whole words.
        let data = [0, 0, 0, 0, 8, 0, 0, 0, 8, 1, 2, 3, 4, 5, 6, 7, 8, 0];
        assert_eq!(read.take_reply(reply(&data)), Ok(true));
        assert_eq!(read.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn segments_alternate_their_toggle_bit() {
        let mut read = Epos4SegmentedRead::new(1, DEVICE_NAME);
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
            let mut read = Epos4SegmentedRead::new(1, DEVICE_NAME);
            assert_eq!(read.take_reply(reply(data)), Err(error), "{data:?}");
        }
    }
}
