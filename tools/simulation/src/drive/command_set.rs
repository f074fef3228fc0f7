//! The command sets of the two families: opcodes and parameters of requests, abort codes.
//!
//! EPOS4: Communication Guide, chapter on the serial line. EPOS2: that of the first EPOS; its
//! parameters come in another order (reference, section 2.1).

use super::family::{Address, Family};
use super::frame::Request;

/// Why a request is refused: the first four bytes of a reply (Communication Guide, table 6-20).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// Toggle bit of a segment not alternated.
    Toggle = 0x0503_0000,
    /// No reply from a node on the CAN bus.
    SdoTimeout = 0x0504_0000,
    Crc = 0x0504_0004,
    UnsupportedAccess = 0x0601_0000,
    WriteOnly = 0x0601_0001,
    ReadOnly = 0x0601_0002,
    NoObject = 0x0602_0000,
    /// Length of the data and of the object differ.
    Length = 0x0607_0010,
    NoSubindex = 0x0609_0011,
    Range = 0x0609_0030,
    /// The signature that protects storing is wrong.
    CannotStore = 0x0800_0020,
    /// Not allowed in this state of the drive.
    WrongState = 0x0800_0022,
    IllegalCommand = 0x0F00_FFBF,
}

/// A request. Node 0 of network management: all.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Service {
    ReadObject(Address),
    WriteObject(Address, u32),
    InitiateSegmentedRead(Address),
    SegmentRead { toggle: bool },
    InitiateSegmentedWrite(Address, usize),
    SegmentedWrite(Segment),
    ManageNetwork { node: u8, command: u8 },
}

/// One segment of a segmented write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Segment {
    pub(super) length: u8,
    pub(super) toggle: bool,
    pub(super) last: bool,
    pub(super) bytes: Vec<u8>,
}

impl Service {
    /// Whether it takes more than one exchange. A gateway does not forward it.
    pub(super) const fn is_segmented(&self) -> bool {
        use Service::{ManageNetwork, ReadObject, WriteObject};
        !matches!(self, ReadObject(_) | WriteObject(..) | ManageNetwork { .. })
    }

    /// Whether the family replies to it. An EPOS2 does not reply to network management.
    pub(super) fn has_reply(&self, family: Family) -> bool {
        family == Family::Epos4 || !matches!(self, Self::ManageNetwork { .. })
    }
}

/// A service, and the node that it addresses, if it names one.
pub(super) type Addressed = (Option<u8>, Service);

pub(super) fn decode(family: Family, request: &Request) -> Result<Addressed, Abort> {
    match family {
        Family::Epos4 => decode_epos4(request.opcode, &request.data),
        Family::Epos2 => decode_epos2(request.opcode, &request.data),
    }
}

fn decode_epos4(opcode: u8, data: &[u8]) -> Result<Addressed, Abort> {
    Ok(match (opcode, data) {
        (0x60, &[node, low, high, sub]) => read(node, [low, high], sub),
        (0x68, &[node, low, high, sub, a, b, c, d]) => write(node, [low, high], sub, [a, b, c, d]),
        (0x81, &[node, low, high, sub]) => initiate_read(node, [low, high], sub),
        (0x62, &[control, _]) => segment_read(control & 1 != 0),
        (0x69, &[node, low, high, sub, a, b, c, d]) => {
            let length = u32::from_le_bytes([a, b, c, d]) as usize;
            (Some(node), Service::InitiateSegmentedWrite(address([low, high], sub), length))
        }
        (0x6A, &[length, control, ref bytes @ ..]) => {
            let (toggle, last) = (control & 1 != 0, control & 2 != 0);
            let bytes = bytes.to_vec();
            (None, Service::SegmentedWrite(Segment { length, toggle, last, bytes }))
        }
        (0x70, &[node, 0, command, 0]) => (None, Service::ManageNetwork { node, command }),
        (0x7A | 0x7B, _) => return Err(Abort::UnsupportedAccess),
        (0x60 | 0x62 | 0x68 | 0x69 | 0x6A | 0x70 | 0x81, _) => return Err(Abort::Length),
        _ => return Err(Abort::IllegalCommand),
    })
}

fn decode_epos2(opcode: u8, data: &[u8]) -> Result<Addressed, Abort> {
    Ok(match (opcode, data) {
        (0x10, &[low, high, sub, node]) => read(node, [low, high], sub),
        (0x11, &[low, high, sub, node, a, b, c, d]) => write(node, [low, high], sub, [a, b, c, d]),
        (0x12, &[low, high, sub, node]) => initiate_read(node, [low, high], sub),
        (0x14, &[control, _]) => segment_read(control & 1 << 6 != 0),
        (0x0E, &[node, 0, command, 0]) => (None, Service::ManageNetwork { node, command }),
        (0x13 | 0x15 | 0x20 | 0x21, _) => return Err(Abort::UnsupportedAccess),
        (0x0E | 0x10 | 0x11 | 0x12 | 0x14, _) => return Err(Abort::Length),
        _ => return Err(Abort::IllegalCommand),
    })
}

fn address(index: [u8; 2], sub: u8) -> Address {
    (u16::from_le_bytes(index), sub)
}

fn read(node: u8, index: [u8; 2], sub: u8) -> Addressed {
    (Some(node), Service::ReadObject(address(index, sub)))
}

fn write(node: u8, index: [u8; 2], sub: u8, raw: [u8; 4]) -> Addressed {
    (Some(node), Service::WriteObject(address(index, sub), u32::from_le_bytes(raw)))
}

fn initiate_read(node: u8, index: [u8; 2], sub: u8) -> Addressed {
    (Some(node), Service::InitiateSegmentedRead(address(index, sub)))
}

fn segment_read(toggle: bool) -> Addressed {
    (None, Service::SegmentRead { toggle })
}

/// A segmented transfer. `toggle` is the toggle bit of the next segment.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) enum SegmentedTransfer {
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
        *self = if left.is_empty() { Self::Idle } else { Self::Read { left, toggle: false } };
    }

    /// Starts a write of `length` bytes.
    pub(super) fn start_write(&mut self, to: Address, length: usize) {
        *self = Self::Write { to, length, written: Vec::new(), toggle: false };
    }

    /// The next segment of `most` bytes or less; whether it is the last. A wrong toggle ends it.
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

#[cfg(test)]
mod tests {
    use super::Family::{Epos2, Epos4};
    use super::*;

    #[test]
    fn each_family_has_its_own_opcodes_and_parameter_order() {
        let written = Ok(write(2, [0x62, 0x20], 0, [0xE8, 0x03, 0, 0]));
        let epos2_write: &[u8] = &[0x62, 0x20, 0, 2, 0xE8, 0x03, 0, 0];
        for (family, opcode, data, expected) in [
            (Epos2, 0x11, epos2_write, written),
            (Epos4, 0x60, &[2, 0x41, 0x60, 0], Ok(read(2, [0x41, 0x60], 0))),
            (Epos4, 0x10, &[0x41, 0x60, 0, 1], Err(Abort::IllegalCommand)),
            (Epos2, 0x60, &[1, 0x41, 0x60, 0], Err(Abort::IllegalCommand)),
            (Epos2, 0x10, &[0x41, 0x60], Err(Abort::Length)),
        ] {
            let data = data.to_vec();
            assert_eq!(decode(family, &Request { opcode, data }), expected);
        }
    }

    #[test]
    fn only_the_epos4_replies_to_network_management() {
        let (node, command) = (0, 1);
        let service = Service::ManageNetwork { node, command };
        assert!(service.has_reply(Epos4) && !service.has_reply(Epos2));
    }
}
