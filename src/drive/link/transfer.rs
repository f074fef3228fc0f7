//! One request and the wait for its reply, in both framings.

use std::io;

use super::{Decode, DriveLink, TimedReply, TransferError};
use crate::config::Framing;
use crate::drive::abort_code::AbortCode;
use crate::drive::capture::Outcome;
use crate::drive::command_set::{DriveRequest, REPLY_OPCODE};
use crate::drive::handshake_frame::{FAILED, HandshakeBody, MAX_BODY, OKAY, body_length, decode};
use crate::drive::serial_frame::MAX_ENCODED;
use crate::drive::serial_frame_parser::{FrameError, ParserEvent};
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// Bytes read from the line at a time; most frames are shorter.
const CHUNK: usize = 64;

/// Bytes of a V2 frame beside its data: sync, opcode, length, CRC; doubled for stuffing.
const V2_OVERHEAD: usize = 12;

/// Bytes of a V1 exchange beside the body of the request and the data of the reply: six bytes of
/// handshake, length and CRC of the reply.
const V1_OVERHEAD: usize = 9;

/// Bytes that arrived together, not consumed yet.
struct ReceiveBuffer {
    bytes: [u8; CHUNK],
    next: usize,
    count: usize,
}

impl ReceiveBuffer {
    fn pop(&mut self) -> Option<u8> {
        let byte = self.bytes.get(self.next..self.count)?.first().copied()?;
        self.next += 1;
        Some(byte)
    }
}

/// A value out of a reply, as a number for the capture.
pub(super) trait Raw {
    fn raw(&self) -> u32;
}

impl Raw for u32 {
    fn raw(&self) -> u32 {
        *self
    }
}

impl Raw for () {
    fn raw(&self) -> u32 {
        0
    }
}

impl Raw for bool {
    fn raw(&self) -> u32 {
        u32::from(*self)
    }
}

impl<T: Transport> DriveLink<T> {
    /// Sends a request once and waits for its reply. The line stays in sync only if exactly one
    /// good reply arrives.
    pub(super) fn attempt<R: Raw>(
        &mut self,
        request: &DriveRequest,
        decode: Decode<'_, R>,
    ) -> Result<TimedReply<R>, TransferError> {
        let before = self.heard;
        let outcome = match self.framing {
            Framing::V2 => self.transfer_v2(request, decode),
            Framing::V1 => self.transfer_v1(request, decode),
        };
        match &outcome {
            Ok(_) | Err(TransferError::Refused(_)) => {
                self.counters.exchanges += 1;
                self.heard = before;
            }
            Err(TransferError::Timeout) => {
                self.counters.timeouts += 1;
                self.lose_sync(1);
            }
            // A request may be on its way, or none.
            Err(TransferError::NotOurTurn) => self.lose_sync(1),
            Err(TransferError::Disturbed) => self.lose_sync(0),
            Err(TransferError::Broken(_)) => {
                self.broken = true;
                self.lose_sync(0);
            }
        }
        self.transport.note(match &outcome {
            Ok((_, value)) => Outcome::Answered(value.raw()),
            Err(TransferError::Refused(code)) => Outcome::Refused(*code),
            Err(TransferError::Timeout | TransferError::NotOurTurn) => Outcome::Timeout,
            Err(TransferError::Disturbed) => Outcome::Disturbed,
            Err(TransferError::Broken(_)) => Outcome::Broken,
        });
        let received = self.transport.now();
        outcome.map(|(sent, value)| TimedReply { value, sent, received })
    }

    /// Sends a request in one frame and reads its reply. Returns when the request was handed over,
    /// and the value.
    fn transfer_v2<R>(
        &mut self,
        request: &DriveRequest,
        decode: Decode<'_, R>,
    ) -> Result<(Nanos, R), TransferError> {
        self.parser.reset();
        // A request holds eight bytes, so it always fits a frame.
        let Ok(bytes) = self.encoder.encode(request.frame()) else {
            return Err(TransferError::Disturbed);
        };
        self.transport.write(bytes)?;
        let sent = self.transport.now();
        let on_wire = bytes.len() + V2_OVERHEAD + 4 * usize::from(request.reply_words());
        let wire_time = Nanos(self.byte_time.0 * on_wire as u64);
        let value = self.receive_v2(sent + self.reply_timeout + wire_time, decode)?;
        Ok((sent, value))
    }

    fn receive_v2<R>(
        &mut self,
        deadline: Nanos,
        decode: Decode<'_, R>,
    ) -> Result<R, TransferError> {
        let mut chunk = [0; CHUNK];
        let mut received = 0;
        // Bytes that have arrived are read even after the deadline: this thread may be late, not
        // the drive. So a line that is never silent is detected by the number of bytes.
        while received <= 2 * MAX_ENCODED {
            let count = self.receive(&mut chunk, deadline)?;
            if count == 0 {
                return Err(TransferError::Timeout);
            }
            received += count;
            for (index, &byte) in chunk.iter().take(count).enumerate() {
                match self.parser.push(byte) {
                    ParserEvent::None => {}
                    ParserEvent::Error(FrameError::LostSync) => {
                        self.counters.resynchronisations += 1;
                    }
                    ParserEvent::Error(FrameError::Crc) => {
                        self.counters.crc_errors += 1;
                        return Err(TransferError::Disturbed);
                    }
                    // With more bytes behind it, either may be the answer.
                    ParserEvent::Frame(frame) if index + 1 < count => {
                        self.heard.note_frame(&frame);
                        return Err(TransferError::Disturbed);
                    }
                    ParserEvent::Frame(frame) => {
                        let value = decode(frame);
                        return Ok(value.inspect_err(|_| self.heard.note_frame(&frame))?);
                    }
                }
            }
        }
        Err(TransferError::Disturbed)
    }

    /// Sends a request part by part, with a handshake for each, and reads its reply. Returns when
    /// the request was handed over, and the value.
    fn transfer_v1<R>(
        &mut self,
        request: &DriveRequest,
        decode_reply: Decode<'_, R>,
    ) -> Result<(Nanos, R), TransferError> {
        let frame = request.frame();
        let Ok(body) = HandshakeBody::new(frame) else {
            return Err(TransferError::Disturbed);
        };
        let mut buffer = ReceiveBuffer { bytes: [0; CHUNK], next: 0, count: 0 };
        let on_wire = V1_OVERHEAD + body.bytes().len() + 2 * usize::from(request.reply_words());
        let deadline =
            self.transport.now() + self.reply_timeout + Nanos(self.byte_time.0 * on_wire as u64);
        self.transport.write(&[frame.opcode])?;
        self.expect(&mut buffer, deadline, OKAY)?;
        self.transport.write(body.bytes())?;
        let sent = self.transport.now();
        match self.receive_byte(&mut buffer, deadline)? {
            OKAY => {}
            // The drive discards the request at once: it may be sent again.
            FAILED => return Err(TransferError::Refused(AbortCode::CRC)),
            byte => return Err(self.unexpected(byte, &mut buffer)),
        }
        self.expect(&mut buffer, deadline, REPLY_OPCODE)?;
        self.transport.write(&[OKAY])?;
        let mut reply = [0; MAX_BODY];
        let reply = self.receive_body(&mut buffer, &mut reply, deadline)?;
        let Some(frame) = decode(REPLY_OPCODE, reply) else {
            self.counters.crc_errors += 1;
            self.heard.note_bytes(reply);
            self.transport.write(&[FAILED])?;
            return Err(TransferError::Disturbed);
        };
        self.transport.write(&[OKAY])?;
        // More bytes behind the reply: the line is out of sync.
        if buffer.pop().is_some() {
            return Err(TransferError::Disturbed);
        }
        let value = decode_reply(frame).inspect_err(|_| self.heard.note_frame(&frame));
        Ok((sent, value?))
    }

    fn expect(
        &mut self,
        buffer: &mut ReceiveBuffer,
        deadline: Nanos,
        expected: u8,
    ) -> Result<(), TransferError> {
        match self.receive_byte(buffer, deadline)? {
            byte if byte == expected => Ok(()),
            byte => Err(self.unexpected(byte, buffer)),
        }
    }

    /// Notes a byte that is no part of the handshake, and what arrived with it.
    fn unexpected(&mut self, byte: u8, buffer: &mut ReceiveBuffer) -> TransferError {
        self.counters.resynchronisations += 1;
        self.heard.note_bytes(&[byte]);
        self.heard.note_bytes(buffer.bytes.get(buffer.next..buffer.count).unwrap_or_default());
        TransferError::Disturbed
    }

    fn receive_body<'a>(
        &mut self,
        buffer: &mut ReceiveBuffer,
        body: &'a mut [u8; MAX_BODY],
        deadline: Nanos,
    ) -> Result<&'a [u8], TransferError> {
        let length = self.receive_byte(buffer, deadline)?;
        let count = body_length(length).ok_or(TransferError::Disturbed)?;
        let body = body.get_mut(..count).ok_or(TransferError::Disturbed)?;
        for (index, byte) in body.iter_mut().enumerate() {
            *byte = match index {
                0 => length,
                _ => self.receive_byte(buffer, deadline)?,
            };
        }
        Ok(body)
    }

    /// Reads what has arrived, and notes it.
    pub(super) fn receive(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        let count = self.transport.read(into, deadline)?;
        self.heard.note_bytes(into.get(..count).unwrap_or_default());
        Ok(count)
    }

    fn receive_byte(
        &mut self,
        buffer: &mut ReceiveBuffer,
        deadline: Nanos,
    ) -> Result<u8, TransferError> {
        if let Some(byte) = buffer.pop() {
            return Ok(byte);
        }
        buffer.count = self.transport.read(&mut buffer.bytes, deadline)?;
        buffer.next = 0;
        buffer.pop().ok_or(TransferError::Timeout)
    }
}
