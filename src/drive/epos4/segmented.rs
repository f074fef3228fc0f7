//! Reading objects of more than four bytes.

use super::dialect::selector;
use crate::drive::dialect::{LONGEST, LongRead, after_error_code};
use crate::drive::frame::Frame;
use crate::drive::object::Address;
use crate::drive::request::{ReplyError, Request};

const INITIATE_SEGMENTED_READ: u8 = 0x81;
const SEGMENT_READ: u8 = 0x62;

/// Words of data in the longest reply to the first request: error code, total length, length, 255
/// bytes.
const FIRST_REPLY_WORDS: u8 = 132;

/// Words of data in the longest reply to the others: error code, length, control, 255 bytes.
const NEXT_REPLY_WORDS: u8 = 131;

const TOGGLE: u8 = 1 << 0;
const LAST: u8 = 1 << 1;

/// A segmented read under way.
#[derive(Debug)]
pub(super) struct SegmentedRead {
    node: u8,
    object: Address,
    bytes: Vec<u8>,
    stage: Stage,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The transfer has to be opened.
    First,
    /// Opened; the next segment carries this toggle bit.
    Next { total: usize, toggle: u8 },
}

impl SegmentedRead {
    pub(super) fn new(node: u8, object: Address) -> Self {
        Self {
            node,
            object,
            bytes: Vec::new(),
            stage: Stage::First,
        }
    }

    fn take_first(&mut self, rest: &[u8]) -> Result<bool, ReplyError> {
        let (total, rest) = rest.split_first_chunk::<4>().ok_or(ReplyError::OutOfStep)?;
        let (&length, data) = rest.split_first().ok_or(ReplyError::OutOfStep)?;
        let total = usize::try_from(u32::from_le_bytes(*total)).unwrap_or(usize::MAX);
        if total > LONGEST {
            return Err(ReplyError::OutOfStep);
        }
        self.stage = Stage::Next { total, toggle: 0 };
        self.append(length, data, total)?;
        Ok(self.bytes.len() == total)
    }

    fn take_next(&mut self, rest: &[u8], total: usize, toggle: u8) -> Result<bool, ReplyError> {
        let &[length, control, ref data @ ..] = rest else {
            return Err(ReplyError::OutOfStep);
        };
        if control & TOGGLE != toggle {
            return Err(ReplyError::OutOfStep);
        }
        self.append(length, data, total)?;
        self.stage = Stage::Next {
            total,
            toggle: toggle ^ TOGGLE,
        };
        match (control & LAST != 0, self.bytes.len() == total) {
            (_, true) => Ok(true),
            (false, false) => Ok(false),
            (true, false) => Err(ReplyError::OutOfStep),
        }
    }

    fn append(&mut self, length: u8, data: &[u8], total: usize) -> Result<(), ReplyError> {
        let segment = data
            .get(..usize::from(length))
            .ok_or(ReplyError::OutOfStep)?;
        if self.bytes.len() + segment.len() > total {
            return Err(ReplyError::OutOfStep);
        }
        self.bytes.extend_from_slice(segment);
        Ok(())
    }
}

impl LongRead for SegmentedRead {
    fn request(&self) -> Request {
        match self.stage {
            Stage::First => Request::new(
                INITIATE_SEGMENTED_READ,
                selector(self.node, self.object),
                FIRST_REPLY_WORDS,
            ),
            Stage::Next { toggle, .. } => Request::new(SEGMENT_READ, [toggle, 0], NEXT_REPLY_WORDS),
        }
    }

    fn take(&mut self, reply: Frame<'_>) -> Result<bool, ReplyError> {
        let rest = after_error_code(reply)?;
        match self.stage {
            Stage::First => self.take_first(rest),
            Stage::Next { total, toggle } => self.take_next(rest, total, toggle),
        }
    }

    fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::super::object::FULL_SERIAL_NUMBER;
    use super::*;
    use crate::drive::dialect::REPLY;
    use crate::drive::object::DEVICE_NAME;
    use crate::drive::request::AbortCode;

    fn reply(data: &[u8]) -> Frame<'_> {
        Frame {
            opcode: REPLY,
            data,
        }
    }

    #[test]
    fn a_serial_number_comes_in_one_reply() {
        let mut read = SegmentedRead::new(1, FULL_SERIAL_NUMBER);
        assert_eq!(
            read.request().frame(),
            Frame {
                opcode: 0x81,
                data: &[0x01, 0x00, 0x21, 0x01]
            }
        );
        // Seventeen bytes, padded to whole words.
        let data = [0, 0, 0, 0, 8, 0, 0, 0, 8, 1, 2, 3, 4, 5, 6, 7, 8, 0];
        assert_eq!(read.take(reply(&data)), Ok(true));
        assert_eq!(read.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn segments_alternate_their_toggle_bit() {
        let mut read = SegmentedRead::new(1, DEVICE_NAME);
        assert_eq!(
            read.take(reply(&[0, 0, 0, 0, 5, 0, 0, 0, 1, b'E'])),
            Ok(false)
        );
        assert_eq!(
            read.request().frame(),
            Frame {
                opcode: 0x62,
                data: &[0, 0]
            }
        );
        assert_eq!(read.take(reply(&[0, 0, 0, 0, 2, 0, b'P', b'O'])), Ok(false));
        assert_eq!(
            read.request().frame(),
            Frame {
                opcode: 0x62,
                data: &[1, 0]
            }
        );
        assert_eq!(read.take(reply(&[0, 0, 0, 0, 2, 3, b'S', b'4'])), Ok(true));
        assert_eq!(read.bytes(), b"EPOS4");
    }

    #[test]
    fn a_refusal_is_passed_on_and_nonsense_is_out_of_step() {
        let take = |data: &[u8]| SegmentedRead::new(1, DEVICE_NAME).take(reply(data));
        assert_eq!(
            take(&[0, 0, 2, 6]),
            Err(ReplyError::Refused(AbortCode(0x0602_0000)))
        );
        assert_eq!(take(&[0; 4]), Err(ReplyError::OutOfStep));
        assert_eq!(
            take(&[0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0]),
            Err(ReplyError::OutOfStep)
        );
        assert_eq!(
            take(&[0, 0, 0, 0, 1, 0, 0, 0, 9, 1]),
            Err(ReplyError::OutOfStep)
        );
    }

    #[test]
    fn a_repeated_segment_is_out_of_step() {
        let mut read = SegmentedRead::new(1, DEVICE_NAME);
        read.take(reply(&[0, 0, 0, 0, 5, 0, 0, 0, 1, b'E']))
            .unwrap();
        read.take(reply(&[0, 0, 0, 0, 1, 0, b'P', 0])).unwrap();
        assert_eq!(
            read.take(reply(&[0, 0, 0, 0, 1, 0, b'P', 0])),
            Err(ReplyError::OutOfStep)
        );
    }

    proptest! {
        #[test]
        fn random_replies_never_panic(replies in vec(vec(any::<u8>(), 0..40), 1..8)) {
            let mut read = SegmentedRead::new(1, DEVICE_NAME);
            for mut data in replies {
                data.splice(0..0, [0; 4]);
                let _ = read.take(reply(&data));
                prop_assert!(read.bytes().len() <= LONGEST);
            }
        }
    }
}
