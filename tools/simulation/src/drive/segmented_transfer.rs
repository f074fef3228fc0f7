//! State of a segmented read or write.

use super::abort::Abort;
use super::command_set::Segment;
use super::object_map::Address;

/// A segmented transfer. `toggle` is the toggle bit of the next segment.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) enum SegmentedTransfer {
    /// None.
    #[default]
    Idle,
    /// The bytes that are left to read.
    Read { left: Vec<u8>, toggle: bool },
    /// The bytes that have been written so far, of `length`.
    Write { to: Address, length: usize, written: Vec<u8>, toggle: bool },
}

impl SegmentedTransfer {
    /// Starts a read of these bytes; no bytes end it at once.
    pub(super) fn start_read(&mut self, left: Vec<u8>) {
        let toggle = false;
        *self = if left.is_empty() { Self::Idle } else { Self::Read { left, toggle } };
    }

    /// Starts a write of `length` bytes.
    pub(super) fn start_write(&mut self, to: Address, length: usize) {
        let (written, toggle) = (Vec::new(), false);
        *self = Self::Write { to, length, written, toggle };
    }

    /// The next segment of at most `most` bytes, and the flag of the last one. A wrong toggle bit
    /// ends the transfer.
    pub(super) fn read(&mut self, toggle: bool, most: usize) -> Result<(Vec<u8>, bool), Abort> {
        match std::mem::take(self) {
            Self::Read { mut left, toggle: expected } if toggle == expected => {
                let rest = left.split_off(left.len().min(most));
                let last = rest.is_empty();
                if !last {
                    *self = Self::Read { left: rest, toggle: !toggle };
                }
                Ok((left, last))
            }
            _ => Err(Abort::Toggle),
        }
    }

    /// Takes a segment. The last one returns the object and the value to write.
    pub(super) fn write(&mut self, segment: &Segment) -> Result<Option<(Address, u32)>, Abort> {
        match std::mem::take(self) {
            Self::Write { to, length, mut written, toggle } if toggle == segment.toggle => {
                let used = segment.bytes.get(..usize::from(segment.length));
                written.extend_from_slice(used.ok_or(Abort::Length)?);
                if !segment.last {
                    *self = Self::Write { to, length, written, toggle: !toggle };
                    return Ok(None);
                }
                if written.len() != length || !(1..=4).contains(&length) {
                    return Err(Abort::Length);
                }
                written.resize(4, 0);
                let raw = written.try_into().map_err(|_| Abort::Length)?;
                Ok(Some((to, u32::from_le_bytes(raw))))
            }
            _ => Err(Abort::Toggle),
        }
    }
}
