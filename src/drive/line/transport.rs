//! The line to the drives, and its clock.

use std::{fmt, io};

use crate::drive::object::AbortCode;
use crate::units::Nanos;

/// How an attempt ended: a request, and the wait for its reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Answered: the four bytes of a read; of a segment 1 if it is the last one; else 0.
    Answered(u32),
    Refused(AbortCode),
    Timeout,
    /// A damaged reply, or a reply to another request.
    Disturbed,
    Broken,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Answered(value) => write!(f, "answered 0x{value:08X}"),
            Self::Refused(code) => write!(f, "refused: {code}"),
            Self::Timeout => f.write_str("no reply in time"),
            Self::Disturbed => f.write_str("disturbed"),
            Self::Broken => f.write_str("the port is broken"),
        }
    }
}

impl Outcome {
    pub(in crate::drive) fn to_bytes(self) -> [u8; 5] {
        let (code, value) = match self {
            Self::Answered(value) => (0, value),
            Self::Refused(code) => (1, code.0),
            Self::Timeout => (2, 0),
            Self::Disturbed => (3, 0),
            Self::Broken => (4, 0),
        };
        let [a, b, c, d] = value.to_le_bytes();
        [code, a, b, c, d]
    }

    pub(in crate::drive) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (&code, value) = bytes.split_first()?;
        let value = u32::from_le_bytes(value.try_into().ok()?);
        Some(match code {
            0 => Self::Answered(value),
            1 => Self::Refused(AbortCode(value)),
            2 => Self::Timeout,
            3 => Self::Disturbed,
            _ => Self::Broken,
        })
    }
}

/// The error of a line that now belongs to another process.
pub(crate) const NOT_OUR_TURN: io::ErrorKind = io::ErrorKind::PermissionDenied;

/// A line that carries bytes both ways, with its clock: a simulated line can run in simulated time,
/// so tests are exact and fast.
pub trait Transport {
    /// Hands all bytes to the line in one call: on USB every call costs a packet. Fails when the
    /// line is broken. Bytes waiting to be sent are not an error.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Reads the bytes that have arrived, and waits for the first one until `deadline`. 0: none
    /// came. Bytes that have arrived are returned even if the deadline has passed. Fails when the
    /// line is broken.
    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize>;

    /// Reopens a broken line: the cable may be plugged in again, with a different device under the
    /// same name. May block. A line that cannot break has nothing to do. Fails when it is still
    /// broken.
    fn reopen(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// Whether an exchange may begin; if not, every request fails with `NOT_OUR_TURN`.
    fn is_our_turn(&mut self) -> bool {
        true
    }

    /// Records the outcome of an attempt, if the transport keeps it.
    fn note(&mut self, _outcome: Outcome) {}

    fn now(&self) -> Nanos;

    /// Sleeps until an instant, or not at all if it has passed.
    fn sleep_until(&mut self, until: Nanos);
}
