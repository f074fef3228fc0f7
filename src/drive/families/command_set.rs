//! The command set of a family: requests and replies. No I/O.

use crate::drive::object::{AbortCode, Address, Setting};
use crate::drive::serial_frame::SerialFrame;

/// A request: opcode and up to eight bytes of data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriveRequest {
    opcode: u8,
    data: [u8; 8],
    length: u8,
    pub(crate) reply_words: u8,
}

impl DriveRequest {
    /// A request. `reply_words` is the largest number of data words in its reply.
    pub fn new<const N: usize>(opcode: u8, data: [u8; N], reply_words: u8) -> Self {
        const { assert!(N <= 8, "a request holds at most eight bytes") };
        let mut bytes = [0; 8];
        bytes[..N].copy_from_slice(&data);
        Self { opcode, data: bytes, length: N as u8, reply_words }
    }

    pub fn frame(&self) -> SerialFrame<'_> {
        let data = self.data.get(..usize::from(self.length));
        SerialFrame { opcode: self.opcode, data: data.unwrap_or(&self.data) }
    }
}

/// Content of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Requested {
    /// The value of an object: node, index, subindex.
    Read(u8, u16, u8),
    /// Writing a value: node, index, subindex, four bytes.
    Write(u8, u16, u8, u32),
    /// The first segment of an object: node, index, subindex.
    FirstSegment(u8, u16, u8),
    NextSegment,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReplyError {
    Refused(AbortCode),
    /// A good frame, but no answer to this request: the line is out of sync.
    Mismatch,
}

pub(in crate::drive) const REPLY_OPCODE: u8 = 0x00;

/// Words of data in the reply to a read: error code and value. To a write: error code, and in a
/// refusal up to as many.
const REPLY_WORDS: u8 = 4;

/// The longest value that is read in segments, bytes; a longer one is refused.
pub(in crate::drive) const MAX_SEGMENTED: usize = 1024;

/// The requests of a family: opcodes and order of the parameters. A line has one command set, that
/// of the drive that the port belongs to: it forwards requests to drives of other families.
#[derive(Debug)]
pub struct CommandSet {
    pub(in crate::drive) read: u8,
    pub(in crate::drive) write: u8,
    pub(in crate::drive) first_segment: u8,
    pub(in crate::drive) next_segment: u8,
    /// Every object request starts with node, index and subindex; else the node is the last.
    pub(in crate::drive) node_first: bool,
    /// Words of data in the longest reply to the first request of a segment, and to the others.
    pub(in crate::drive) segment_words: [u8; 2],
    /// The toggle bit of the request for a segment.
    pub(in crate::drive) toggle: u8,
    /// The segment in a reply after its error code, the first or a later one; `None`: damaged.
    pub(in crate::drive) first: fn(&[u8]) -> Option<Segment<'_>>,
    pub(in crate::drive) next: fn(&[u8]) -> Option<Segment<'_>>,
}

#[derive(Debug, Default)]
pub(in crate::drive) struct Segment<'a> {
    pub data: &'a [u8],
    /// Length of the whole value, if the reply has it.
    pub total: Option<usize>,
    pub toggle: Option<bool>,
    pub is_last: bool,
}

impl CommandSet {
    /// Reads an object of at most four bytes.
    pub fn read(&self, node: u8, object: Address) -> DriveRequest {
        DriveRequest::new(self.read, self.selector(node, object), REPLY_WORDS)
    }

    /// Writes an object of at most four bytes.
    pub fn write(&self, node: u8, setting: Setting) -> DriveRequest {
        let [a, b, c, d] = self.selector(node, setting.object);
        let [e, f, g, h] = setting.raw.to_le_bytes();
        DriveRequest::new(self.write, [a, b, c, d, e, f, g, h], REPLY_WORDS)
    }

    /// Starts to read an object of any length. Allocates; for bring-up only.
    pub fn read_segmented(&'static self, node: u8, object: Address) -> SegmentedRead {
        let (bytes, is_open, total, toggle) = (Vec::new(), false, None, false);
        SegmentedRead { commands: self, node, object, bytes, is_open, total, toggle }
    }

    /// First four bytes of an object request.
    pub(in crate::drive) const fn selector(&self, node: u8, object: Address) -> [u8; 4] {
        let ([low, high], subindex) = (object.index.to_le_bytes(), object.subindex);
        if self.node_first { [node, low, high, subindex] } else { [low, high, subindex, node] }
    }

    /// Content of a request; `None`: not of this software. Missing data counts as zeros.
    pub fn parse(&self, request: SerialFrame<'_>) -> Option<Requested> {
        let mut data = request.data.iter().copied().chain(std::iter::repeat(0));
        let mut next = || std::array::from_fn::<u8, 4, _>(|_| data.next().unwrap_or_default());
        let (mut place, raw) = (next(), u32::from_le_bytes(next()));
        place.rotate_left(usize::from(self.node_first));
        let [low, high, subindex, node] = place;
        let index = u16::from_le_bytes([low, high]);
        match request.opcode {
            code if code == self.read => Some(Requested::Read(node, index, subindex)),
            code if code == self.write => Some(Requested::Write(node, index, subindex, raw)),
            code if code == self.first_segment => {
                Some(Requested::FirstSegment(node, index, subindex))
            }
            code if code == self.next_segment => Some(Requested::NextSegment),
            _ => None,
        }
    }

    /// The value in the reply to [`CommandSet::read`], truncated to the size of the object. It
    /// comes in four bytes, whose upper ones are undefined; some hosts have read two for a short
    /// object. Fails when the drive refused, or the frame is not a reply to a read.
    pub fn read_reply(&self, reply: SerialFrame<'_>, object: Address) -> Result<u32, ReplyError> {
        match *after_error_code(reply)? {
            [a, b, c, d] => Ok(object.truncate(u32::from_le_bytes([a, b, c, d]))),
            [a, b] if matches!(object.size, 1 | 2) => {
                Ok(object.truncate(u32::from(u16::from_le_bytes([a, b]))))
            }
            _ => Err(ReplyError::Mismatch),
        }
    }

    /// Checks the reply to a write. Fails when the drive refused, or the frame is not one.
    pub fn write_reply(&self, reply: SerialFrame<'_>) -> Result<(), ReplyError> {
        if after_error_code(reply)?.is_empty() { Ok(()) } else { Err(ReplyError::Mismatch) }
    }
}

/// A read in several requests.
#[derive(Debug)]
pub struct SegmentedRead {
    commands: &'static CommandSet,
    node: u8,
    object: Address,
    bytes: Vec<u8>,
    /// The first request was answered.
    is_open: bool,
    /// Length of the whole value, if known.
    total: Option<usize>,
    /// Toggle bit of the next segment.
    toggle: bool,
}

impl SegmentedRead {
    pub(in crate::drive) fn request(&self) -> DriveRequest {
        let (commands, [first, next]) = (self.commands, self.commands.segment_words);
        if self.is_open {
            let toggle = if self.toggle { commands.toggle } else { 0 };
            DriveRequest::new(commands.next_segment, [toggle, 0], next)
        } else {
            let selector = commands.selector(self.node, self.object);
            DriveRequest::new(commands.first_segment, selector, first)
        }
    }

    /// Handles the reply; `true` at the end. Fails for a refusal, or a reply to another request.
    pub fn take_reply(&mut self, reply: SerialFrame<'_>) -> Result<bool, ReplyError> {
        let rest = after_error_code(reply)?;
        let parse = if self.is_open { self.commands.next } else { self.commands.first };
        let segment = parse(rest).ok_or(ReplyError::Mismatch)?;
        let (length, total) = (self.bytes.len() + segment.data.len(), segment.total.or(self.total));
        let is_repeated = segment.toggle.is_some_and(|toggle| toggle != self.toggle);
        let most = total.unwrap_or(MAX_SEGMENTED);
        if is_repeated || most > MAX_SEGMENTED || length > most {
            return Err(ReplyError::Mismatch);
        }
        self.bytes.extend_from_slice(segment.data);
        self.toggle ^= segment.toggle.is_some();
        (self.is_open, self.total) = (true, total);
        match total {
            Some(total) if length < total && segment.is_last => Err(ReplyError::Mismatch),
            Some(total) => Ok(length == total),
            None => Ok(segment.is_last),
        }
    }

    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

/// The data of a reply after its error code, if that is 0. It is unknown whether a refused read is
/// answered with two words or with as many as its value: all are accepted.
pub(in crate::drive) fn after_error_code(reply: SerialFrame<'_>) -> Result<&[u8], ReplyError> {
    let Some((error, rest)) = reply.data.split_first_chunk::<4>() else {
        return Err(ReplyError::Mismatch);
    };
    match (reply.opcode, u32::from_le_bytes(*error)) {
        (REPLY_OPCODE, 0) => Ok(rest),
        (REPLY_OPCODE, code) if matches!(rest.len(), 0 | 2 | 4) => {
            Err(ReplyError::Refused(AbortCode(code)))
        }
        _ => Err(ReplyError::Mismatch),
    }
}
