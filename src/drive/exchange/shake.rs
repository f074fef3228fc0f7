//! One request and its reply in V1 frames: every part waits for a byte of hand-shake.

use super::Link;
use super::attempt::{Decode, Miss};
use crate::drive::handshake::{FAILED, MAX_REST, OKAY, Rest, open, rest_length};
use crate::drive::request::{AbortCode, ReplyError, Request};
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// The opcode that opens a reply.
const REPLY: u8 = 0x00;

/// Bytes of hand-shake in an exchange, the two opcodes among them.
pub(super) const SHAKES: usize = 6;

/// Bytes taken from the line at a time.
const CHUNK: usize = 64;

/// Bytes that came together. The drive waits for the host again and again, so they are few.
struct Inbox {
    bytes: [u8; CHUNK],
    next: usize,
    held: usize,
}

impl Inbox {
    fn next(&mut self) -> Option<u8> {
        let byte = self.bytes.get(self.next..self.held)?.first().copied()?;
        self.next += 1;
        Some(byte)
    }
}

impl<T: Transport> Link<T> {
    /// Sends a request part by part and reads its reply. Returns when the request had been handed
    /// over, and the value.
    pub(super) fn shake<R>(
        &mut self,
        request: &Request,
        decode: Decode<'_, R>,
    ) -> Result<(Nanos, R), Miss> {
        let frame = request.frame();
        let Ok(rest) = Rest::of(frame) else {
            return Err(Miss::Disturbed);
        };
        let mut inbox = Inbox {
            bytes: [0; CHUNK],
            next: 0,
            held: 0,
        };
        let on_wire = SHAKES + rest.bytes().len() + 3 + 2 * usize::from(request.reply_words());
        let deadline =
            self.transport.now() + self.reply_timeout + Nanos(self.byte_time.0 * on_wire as u64);
        self.transport.write(&[frame.opcode])?;
        self.expect(&mut inbox, deadline, OKAY)?;
        self.transport.write(rest.bytes())?;
        let sent = self.transport.now();
        match self.byte(&mut inbox, deadline)? {
            OKAY => {}
            // The drive forgets the request at once: it may be sent again.
            FAILED => return Err(Miss::Refused(AbortCode::CRC)),
            _ => return Err(Miss::Disturbed),
        }
        self.expect(&mut inbox, deadline, REPLY)?;
        self.transport.write(&[OKAY])?;
        let mut reply = [0; MAX_REST];
        let reply = self.rest(&mut inbox, &mut reply, deadline)?;
        let Some(frame) = open(REPLY, reply) else {
            self.counters.crc_errors += 1;
            self.transport.write(&[FAILED])?;
            return Err(Miss::Disturbed);
        };
        self.transport.write(&[OKAY])?;
        // With more behind it, something is out of step.
        if inbox.next().is_some() {
            return Err(Miss::Disturbed);
        }
        decode(frame)
            .map(|value| (sent, value))
            .map_err(|error| match error {
                ReplyError::Refused(code) => Miss::Refused(code),
                ReplyError::OutOfStep => Miss::Disturbed,
            })
    }

    fn expect(&mut self, inbox: &mut Inbox, deadline: Nanos, wanted: u8) -> Result<(), Miss> {
        if self.byte(inbox, deadline)? == wanted {
            return Ok(());
        }
        self.counters.resynchronisations += 1;
        Err(Miss::Disturbed)
    }

    fn rest<'a>(
        &mut self,
        inbox: &mut Inbox,
        into: &'a mut [u8; MAX_REST],
        deadline: Nanos,
    ) -> Result<&'a [u8], Miss> {
        let length = self.byte(inbox, deadline)?;
        let wanted = rest_length(length).ok_or(Miss::Disturbed)?;
        let Some((first, behind)) = into.get_mut(..wanted).and_then(<[u8]>::split_first_mut) else {
            return Err(Miss::Disturbed);
        };
        *first = length;
        for place in behind {
            *place = self.byte(inbox, deadline)?;
        }
        Ok(into.get(..wanted).unwrap_or_default())
    }

    fn byte(&mut self, inbox: &mut Inbox, deadline: Nanos) -> Result<u8, Miss> {
        if let Some(byte) = inbox.next() {
            return Ok(byte);
        }
        inbox.held = self.transport.read(&mut inbox.bytes, deadline)?;
        inbox.next = 0;
        inbox.next().ok_or(Miss::Silent)
    }
}
