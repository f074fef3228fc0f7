//! How drives of a family are asked: opcodes and the order of the parameters. Sans I/O.

use std::fmt;

use super::frame::Frame;
use super::object::{Address, Setting};
use super::request::{AbortCode, ReplyError, Request};

/// The opcode of every reply.
pub(super) const REPLY: u8 = 0x00;

/// Words of data in the reply to a read: error code and value.
pub(super) const READ_REPLY_WORDS: u8 = 4;

/// Words of data in the reply to a write: error code. A refused one may have as many as a read.
pub(super) const WRITE_REPLY_WORDS: u8 = 4;

/// Nothing that we read in segments is longer; a drive that says so is not believed.
pub(super) const LONGEST: usize = 1024;

/// How a family is asked. On a line there is one dialect, that of the drive that the port belongs
/// to: it passes requests on to drives of other families behind it.
pub trait Dialect: fmt::Debug + Sync {
    /// Asks for the value of an object of at most four bytes.
    fn read(&self, node: u8, object: Address) -> Request;

    /// Sets an object of at most four bytes.
    fn write(&self, node: u8, setting: Setting) -> Request;

    /// Starts to read an object of any length. Used at start only: it allocates.
    fn read_long(&self, node: u8, object: Address) -> Box<dyn LongRead>;

    /// The four bytes in the reply to [`Dialect::read`]; cut them to the size of the object.
    ///
    /// # Errors
    ///
    /// When the drive refused, or the frame is no reply to a read.
    fn read_reply(&self, reply: Frame<'_>) -> Result<u32, ReplyError> {
        match after_error_code(reply)? {
            &[a, b, c, d] => Ok(u32::from_le_bytes([a, b, c, d])),
            _ => Err(ReplyError::OutOfStep),
        }
    }

    /// Judges the reply to [`Dialect::write`].
    ///
    /// # Errors
    ///
    /// When the drive refused, or the frame is no reply to a write.
    fn write_reply(&self, reply: Frame<'_>) -> Result<(), ReplyError> {
        if after_error_code(reply)?.is_empty() {
            Ok(())
        } else {
            Err(ReplyError::OutOfStep)
        }
    }
}

/// A read that takes several requests.
pub trait LongRead {
    /// The next request.
    fn request(&self) -> Request;

    /// Takes the reply; `true` when the value is complete.
    ///
    /// # Errors
    ///
    /// When the drive refused, or the frame is no reply to the request.
    fn take(&mut self, reply: Frame<'_>) -> Result<bool, ReplyError>;

    /// The bytes read so far.
    fn bytes(&self) -> &[u8];
}

/// The data of a reply after its error code, if that is 0.
///
/// Whether a refused read is answered with two words or four is not known: both are taken.
pub(super) fn after_error_code(reply: Frame<'_>) -> Result<&[u8], ReplyError> {
    let Some((error, rest)) = reply.data.split_first_chunk::<4>() else {
        return Err(ReplyError::OutOfStep);
    };
    match (reply.opcode, u32::from_le_bytes(*error)) {
        (REPLY, 0) => Ok(rest),
        (REPLY, code) if matches!(rest.len(), 0 | 4) => Err(ReplyError::Refused(AbortCode(code))),
        _ => Err(ReplyError::OutOfStep),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::config::{Family, PortConfig};
    use crate::drive::object;

    proptest! {
        /// Four bytes behind an error code of 0 are the value, none are a success; nothing else is
        /// believed.
        #[test]
        fn any_reply_is_read_or_refused(opcode: u8, data in prop::collection::vec(any::<u8>(), 0..300), good: bool) {
            let (opcode, data) = if good { (REPLY, [&[0; 4], &data[..]].concat()) } else { (opcode, data) };
            let reply = Frame { opcode, data: &data };
            let sound = opcode == REPLY && data.starts_with(&[0; 4]);
            for family in [Family::Epos4, Family::Epos2] {
                let port = PortConfig { family, ..PortConfig::new("/dev/null".into(), Vec::new()) };
                let dialect = crate::drive::family::of_port(&port).dialect();
                prop_assert_eq!(dialect.read_reply(reply).is_ok(), sound && data.len() == 8);
                prop_assert_eq!(dialect.write_reply(reply).is_ok(), sound && data.len() == 4);
                let _ = dialect.read_long(1, object::DEVICE_NAME).take(reply);
            }
        }
    }
}
