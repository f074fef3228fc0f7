//! One request and the wait for its reply.

use std::io;

use super::{Answer, Link};
use crate::config::Framing;
use crate::drive::frame::{Damage, Frame, MAX_ENCODED, Parsed};
use crate::drive::request::{AbortCode, ReplyError, Request};
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// Bytes taken from the line at a time; most frames are shorter.
const CHUNK: usize = 64;

/// Bytes of a frame beside its data: sync, opcode, length, CRC; doubled for stuffing.
const FRAME_OVERHEAD: usize = 12;

/// Why an attempt failed.
pub(super) enum Miss {
    /// The drive said no; the line is fine.
    Refused(AbortCode),
    /// No reply in time.
    Silent,
    /// A damaged reply, or one to something else.
    Disturbed,
    /// The port is broken.
    Broken(io::ErrorKind),
}

impl From<io::Error> for Miss {
    fn from(error: io::Error) -> Self {
        Self::Broken(error.kind())
    }
}

/// Reads the value out of a reply.
pub(super) type Decode<'a, R> = &'a mut dyn FnMut(Frame<'_>) -> Result<R, ReplyError>;

impl<T: Transport> Link<T> {
    /// Sends a request once and waits for its reply. The line stays in step only if exactly one
    /// good reply arrives.
    pub(super) fn attempt<R>(
        &mut self,
        request: &Request,
        decode: Decode<'_, R>,
    ) -> Result<Answer<R>, Miss> {
        let begin = self.transport.now();
        let outcome = match self.framing {
            Framing::V2 => self.send(request, decode),
            Framing::V1 => self.shake(request, decode),
        };
        match outcome {
            Ok((sent, value)) => {
                let received = self.transport.now();
                self.counters.exchanges += 1;
                self.counters.round_trips.record(received - begin);
                Ok(Answer {
                    value,
                    sent,
                    received,
                })
            }
            Err(miss) => {
                match miss {
                    Miss::Refused(_) => self.counters.exchanges += 1,
                    Miss::Silent => {
                        self.counters.timeouts += 1;
                        self.fall_out_of_step(1);
                    }
                    Miss::Disturbed => self.fall_out_of_step(0),
                    Miss::Broken(_) => {
                        self.broken = true;
                        self.fall_out_of_step(0);
                    }
                }
                Err(miss)
            }
        }
    }

    /// Sends a request in one frame and reads its reply. Returns when the request had been handed
    /// over, and the value.
    fn send<R>(&mut self, request: &Request, decode: Decode<'_, R>) -> Result<(Nanos, R), Miss> {
        self.parser.reset();
        // A request holds eight bytes, so it always fits a frame.
        let Ok(bytes) = self.encoder.encode(request.frame()) else {
            return Err(Miss::Disturbed);
        };
        self.transport.write(bytes)?;
        let sent = self.transport.now();
        let on_wire = bytes.len() + FRAME_OVERHEAD + 4 * usize::from(request.reply_words());
        let wire_time = Nanos(self.byte_time.0 * on_wire as u64);
        self.receive(sent + self.reply_timeout + wire_time, decode)
            .map(|value| (sent, value))
    }

    fn receive<R>(&mut self, deadline: Nanos, decode: Decode<'_, R>) -> Result<R, Miss> {
        let mut chunk = [0; CHUNK];
        let mut received = 0;
        // What has arrived is read even after the deadline: this thread may have been late, not the
        // drive. So a line that never falls silent is told by the number of bytes.
        while received <= 2 * MAX_ENCODED {
            let count = self.transport.read(&mut chunk, deadline)?;
            if count == 0 {
                return Err(Miss::Silent);
            }
            received += count;
            let bytes = chunk.get(..count).unwrap_or(&chunk);
            for (place, &byte) in bytes.iter().enumerate() {
                match self.parser.push(byte) {
                    Parsed::Nothing => {}
                    Parsed::Damaged(Damage::LostSync) => self.counters.resynchronisations += 1,
                    Parsed::Damaged(Damage::Crc) => {
                        self.counters.crc_errors += 1;
                        return Err(Miss::Disturbed);
                    }
                    Parsed::Frame(frame) => {
                        // With more behind it, either may be the answer.
                        if place + 1 < count {
                            return Err(Miss::Disturbed);
                        }
                        return decode(frame).map_err(|error| match error {
                            ReplyError::Refused(code) => Miss::Refused(code),
                            ReplyError::OutOfStep => Miss::Disturbed,
                        });
                    }
                }
            }
        }
        Err(Miss::Disturbed)
    }
}
