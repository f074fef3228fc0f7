//! One request and the wait for its reply.

use std::io;

use super::{Decode, DriveLink, TimedReply, TransferError};
use crate::drive::capture::Outcome;
use crate::drive::command_set::DriveRequest;
use crate::drive::serial_frame::MAX_ENCODED;
use crate::drive::serial_frame_parser::{FrameError, ParserEvent};
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// Bytes read from the line at a time; most frames are shorter.
const CHUNK: usize = 64;

/// Bytes of a frame in addition to its data: sync, opcode, length, CRC; doubled for stuffing.
const OVERHEAD: usize = 12;

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
        let before = self.unexpected;
        let outcome = self.transfer(request, decode);
        match &outcome {
            Ok(_) | Err(TransferError::Refused(_)) => {
                self.counters.exchanges += 1;
                self.unexpected = before;
            }
            Err(TransferError::Timeout) => {
                self.counters.timeouts += 1;
                self.has_timed_out = true;
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
    fn transfer<R>(
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
        let on_wire = bytes.len() + OVERHEAD + 4 * usize::from(request.reply_words);
        let wire_time = Nanos(self.byte_time.0 * on_wire as u64);
        let value = self.receive_frame(sent + self.reply_timeout + wire_time, decode)?;
        Ok((sent, value))
    }

    fn receive_frame<R>(
        &mut self,
        deadline: Nanos,
        decode: Decode<'_, R>,
    ) -> Result<R, TransferError> {
        let mut chunk = [0; CHUNK];
        let (mut received, is_late) = (0, self.has_timed_out);
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
                    // If more bytes follow, either may be the reply.
                    ParserEvent::Frame(frame) if index + 1 < count => {
                        self.unexpected.note_frame(&frame, is_late);
                        return Err(TransferError::Disturbed);
                    }
                    ParserEvent::Frame(frame) => {
                        let value = decode(frame);
                        let note = |_: &_| self.unexpected.note_frame(&frame, is_late);
                        return Ok(value.inspect_err(note)?);
                    }
                }
            }
        }
        Err(TransferError::Disturbed)
    }

    /// Reads what has arrived, and notes it.
    pub(super) fn receive(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        let count = self.transport.read(into, deadline)?;
        self.unexpected.note_bytes(into.get(..count).unwrap_or_default());
        Ok(count)
    }
}
