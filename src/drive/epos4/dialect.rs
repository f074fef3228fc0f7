//! Requests of the EPOS4 (Communication Guide 2019-11): node, index, subindex.

use super::segmented::SegmentedRead;
use crate::drive::dialect::{Dialect, LongRead, READ_REPLY_WORDS, WRITE_REPLY_WORDS};
use crate::drive::object::{Address, Setting};
use crate::drive::request::Request;

const READ_OBJECT: u8 = 0x60;
const WRITE_OBJECT: u8 = 0x68;

/// The dialect of the EPOS4.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Epos4Dialect;

impl Dialect for Epos4Dialect {
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

/// Node, index and subindex, as every object request starts.
pub(super) const fn selector(node: u8, object: Address) -> [u8; 4] {
    let [low, high] = object.index.to_le_bytes();
    [node, low, high, object.subindex]
}

#[cfg(test)]
mod tests {
    use super::super::object;
    use super::*;
    use crate::drive::dialect::REPLY;
    use crate::drive::frame::Frame;
    use crate::drive::request::{AbortCode, ReplyError};

    fn reply(data: &[u8]) -> Frame<'_> {
        Frame {
            opcode: REPLY,
            data,
        }
    }

    #[test]
    fn requests_have_the_layout_of_the_worked_frames() {
        let read = Epos4Dialect.read(1, object::CURRENT.address());
        assert_eq!(
            read.frame(),
            Frame {
                opcode: 0x60,
                data: &[0x01, 0xD1, 0x30, 0x02]
            }
        );
        let write = Epos4Dialect.write(2, object::TARGET.set(-3988));
        assert_eq!(
            write.frame(),
            Frame {
                opcode: 0x68,
                data: &[0x02, 0x7A, 0x60, 0x00, 0x6C, 0xF0, 0xFF, 0xFF]
            }
        );
    }

    #[test]
    fn values_follow_an_error_code_of_zero() {
        assert_eq!(
            Epos4Dialect.read_reply(reply(&[0, 0, 0, 0, 0xC7, 0xCF, 0xFF, 0xFF])),
            Ok(-12345_i32 as u32)
        );
        assert_eq!(Epos4Dialect.write_reply(reply(&[0; 4])), Ok(()));
    }

    #[test]
    fn refusals_are_taken_short_and_long() {
        let refused = ReplyError::Refused(AbortCode(0x0602_0000));
        for data in [&[0, 0, 2, 6][..], &[0, 0, 2, 6, 0, 0, 0, 0]] {
            assert_eq!(Epos4Dialect.read_reply(reply(data)), Err(refused));
            assert_eq!(Epos4Dialect.write_reply(reply(data)), Err(refused));
        }
    }

    #[test]
    fn a_reply_to_another_kind_of_request_is_out_of_step() {
        assert_eq!(
            Epos4Dialect.read_reply(reply(&[0; 4])),
            Err(ReplyError::OutOfStep)
        );
        assert_eq!(
            Epos4Dialect.write_reply(reply(&[0; 8])),
            Err(ReplyError::OutOfStep)
        );
        assert_eq!(
            Epos4Dialect.write_reply(reply(&[])),
            Err(ReplyError::OutOfStep)
        );
        assert_eq!(
            Epos4Dialect.read_reply(Frame {
                opcode: 0x60,
                data: &[0; 8]
            }),
            Err(ReplyError::OutOfStep)
        );
        assert_eq!(
            Epos4Dialect.read_reply(reply(&[1, 0, 0, 0, 0, 0])),
            Err(ReplyError::OutOfStep)
        );
    }
}
