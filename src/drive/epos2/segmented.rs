//! Reading objects of more than four bytes from an EPOS2.
//!
//! The control byte of a segment holds its length (bits 0 to 5), the toggle bit (6) and whether
//! more follow (7). The reply that opens the transfer brings an error code; whether it brings the
//! first segment too is not known, so both are taken.

use super::dialect::selector;
use crate::drive::dialect::{LONGEST, LongRead, after_error_code};
use crate::drive::frame::Frame;
use crate::drive::object::Address;
use crate::drive::request::{ReplyError, Request};

const INITIATE_SEGMENTED_READ: u8 = 0x12;
const SEGMENT_READ: u8 = 0x14;

/// Words of data in the longest reply: error code, control byte, 63 bytes.
const REPLY_WORDS: u8 = 34;

const LENGTH: u8 = 0x3F;
const TOGGLE: u8 = 1 << 6;
const MORE: u8 = 1 << 7;

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
    Next { toggle: u8 },
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

    fn take_segment(&mut self, rest: &[u8], toggle: u8) -> Result<bool, ReplyError> {
        let (&control, data) = rest.split_first().ok_or(ReplyError::OutOfStep)?;
        let segment = data
            .get(..usize::from(control & LENGTH))
            .ok_or(ReplyError::OutOfStep)?;
        if control & TOGGLE != toggle || self.bytes.len() + segment.len() > LONGEST {
            return Err(ReplyError::OutOfStep);
        }
        self.bytes.extend_from_slice(segment);
        self.stage = Stage::Next {
            toggle: toggle ^ TOGGLE,
        };
        Ok(control & MORE == 0)
    }
}

impl LongRead for SegmentedRead {
    fn request(&self) -> Request {
        match self.stage {
            Stage::First => Request::new(
                INITIATE_SEGMENTED_READ,
                selector(self.node, self.object),
                REPLY_WORDS,
            ),
            Stage::Next { toggle } => Request::new(SEGMENT_READ, [toggle, 0], REPLY_WORDS),
        }
    }

    fn take(&mut self, reply: Frame<'_>) -> Result<bool, ReplyError> {
        let rest = after_error_code(reply)?;
        match self.stage {
            Stage::First if rest.is_empty() => {
                self.stage = Stage::Next { toggle: 0 };
                Ok(false)
            }
            Stage::First => self.take_segment(rest, 0),
            Stage::Next { toggle } => self.take_segment(rest, toggle),
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

    fn reply(data: &[u8]) -> Frame<'_> {
        Frame {
            opcode: REPLY,
            data,
        }
    }

    #[test]
    fn segments_alternate_their_toggle_bit() {
        let mut read = SegmentedRead::new(1, FULL_SERIAL_NUMBER);
        assert_eq!(
            read.request().frame(),
            Frame {
                opcode: 0x12,
                data: &[0x04, 0x20, 0, 1]
            }
        );
        assert_eq!(read.take(reply(&[0; 4])), Ok(false));
        assert_eq!(
            read.request().frame(),
            Frame {
                opcode: 0x14,
                data: &[0, 0]
            }
        );
        assert_eq!(
            read.take(reply(&[0, 0, 0, 0, 0x85, 1, 2, 3, 4, 5])),
            Ok(false)
        );
        assert_eq!(
            read.request().frame(),
            Frame {
                opcode: 0x14,
                data: &[0x40, 0]
            }
        );
        assert_eq!(read.take(reply(&[0, 0, 0, 0, 0x43, 6, 7, 8])), Ok(true));
        assert_eq!(read.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn the_first_segment_may_come_at_once() {
        let mut read = SegmentedRead::new(1, FULL_SERIAL_NUMBER);
        assert_eq!(read.take(reply(&[0, 0, 0, 0, 0x03, 1, 2, 3])), Ok(true));
        assert_eq!(read.bytes(), [1, 2, 3]);
    }

    #[test]
    fn a_repeated_or_short_segment_is_out_of_step() {
        let mut read = SegmentedRead::new(1, FULL_SERIAL_NUMBER);
        read.take(reply(&[0; 4])).unwrap();
        read.take(reply(&[0, 0, 0, 0, 0x81, 1])).unwrap();
        assert_eq!(
            read.take(reply(&[0, 0, 0, 0, 0x81, 1])),
            Err(ReplyError::OutOfStep)
        );
        assert_eq!(
            read.take(reply(&[0, 0, 0, 0, 0x49, 1])),
            Err(ReplyError::OutOfStep)
        );
    }

    proptest! {
        #[test]
        fn random_replies_never_panic(replies in vec(vec(any::<u8>(), 0..40), 1..60)) {
            let mut read = SegmentedRead::new(1, FULL_SERIAL_NUMBER);
            for mut data in replies {
                data.splice(0..0, [0; 4]);
                let _ = read.take(reply(&data));
                prop_assert!(read.bytes().len() <= LONGEST);
            }
        }
    }
}
