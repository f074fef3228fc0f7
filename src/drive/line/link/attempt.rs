//! One request and the wait for its reply; synchronising the line: making sure that the next reply
//! belongs to the next request.
//!
//! The line is drained until it is quiet, the parser is reset, and constants with known values are
//! read and compared: the vendor number once, then the serial number. Late replies can disturb this
//! only as follows. The drive answers in the order of the requests, and at most once each. If late
//! replies are still on their way, the answers to these reads arrive after them, shifted by their
//! number `d`. The word "vendor, serial, serial, ..." of length `n` never equals itself shifted by
//! any `d < n`, because the vendor is only at its start. And `d` is at most the number of requests
//! that were not answered. With one read more than that, a shifted line is always detected.

use std::io;

use super::{Decode, DriveLink, GATEWAY_TIMEOUT, LOCAL_NODE, SyncState, TimedReply, TransferError};
use crate::drive::capture::Outcome;
use crate::drive::command_set::DriveRequest;
use crate::drive::error::LinkError;
use crate::drive::object::{self, Object};
use crate::drive::serial_frame::{FrameError, MAX_ENCODED, ParserEvent};
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// Bytes read or discarded at a time; most frames are shorter.
const CHUNK: usize = 64;

/// Bytes of a frame in addition to its data: sync, opcode, length, CRC; doubled for stuffing.
const OVERHEAD: usize = 12;

/// The line counts as quiet after this long without a byte: several times the gap that USB adapters
/// leave between the parts of one reply.
const QUIET: Nanos = Nanos::from_millis(5);

/// A line that is not quiet within this time carries something else than our replies.
const MAX_NOISE: Nanos = Nanos::from_millis(100);

/// Attempts to synchronise before the line is given up. For a gateway they include the time that it
/// may wait for a node.
const ATTEMPTS: u32 = 4;

/// The most late replies that are expected. More happen only on a line that was given up, and a
/// drive that answers again after that is brought up from the start.
const MAX_LATE: u32 = 16;

impl<T: Transport> DriveLink<T> {
    /// Sends a request once and waits for its reply. The line stays in sync only if exactly one
    /// good reply arrives.
    pub(super) fn attempt(
        &mut self,
        request: &DriveRequest,
        decode: Decode<'_>,
    ) -> Result<TimedReply<u32>, TransferError> {
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
            Ok((_, value)) => Outcome::Answered(*value),
            Err(TransferError::Refused(code)) => Outcome::Refused(*code),
            Err(TransferError::Timeout | TransferError::NotOurTurn) => Outcome::Timeout,
            Err(TransferError::Disturbed) => Outcome::Disturbed,
            Err(TransferError::Broken(_)) => Outcome::Broken,
        });
        let received = self.transport.now();
        outcome.map(|(sent, value)| TimedReply { value, sent, received })
    }

    /// Sends a request in one frame. Returns when it was handed over, and the reply's value.
    fn transfer(
        &mut self,
        request: &DriveRequest,
        decode: Decode<'_>,
    ) -> Result<(Nanos, u32), TransferError> {
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

    fn receive_frame(&mut self, deadline: Nanos, decode: Decode<'_>) -> Result<u32, TransferError> {
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
    fn receive(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        let count = self.transport.read(into, deadline)?;
        self.unexpected.note_bytes(into.get(..count).unwrap_or_default());
        Ok(count)
    }

    /// The next reply belongs to the next request.
    pub fn is_in_sync(&self) -> bool {
        self.sync == SyncState::InSync
    }

    /// A request was not answered (`unanswered` is 1), or unexpected bytes arrived (0).
    fn lose_sync(&mut self, unanswered: u32) {
        let late = match self.sync {
            SyncState::InSync => 0,
            SyncState::OutOfSync { late } => late,
        };
        let late = (late + unanswered).clamp(1, MAX_LATE);
        self.sync = SyncState::OutOfSync { late };
    }

    /// Bytes without a request mean that the line is out of sync.
    pub(super) fn detect_stray_bytes(&mut self) -> Result<(), LinkError> {
        let now = self.transport.now();
        let stray = self.discard(now).map_err(LinkError::broken);
        self.broken |= matches!(stray, Err(LinkError::Broken(_)));
        if stray? {
            self.counters.resynchronisations += 1;
            self.lose_sync(0);
        }
        Ok(())
    }

    /// Discards bytes until the line is quiet, for a bounded time. Fails when it is broken.
    pub(crate) fn wait_for_quiet(&mut self) -> Result<(), LinkError> {
        self.drain().map(|_| ()).map_err(LinkError::broken)
    }

    /// Waits for what a gateway says in the place of a node; `false` if that is nothing.
    pub(in crate::drive) fn is_answered_by_gateway(&mut self) -> bool {
        let end = self.transport.now() + GATEWAY_TIMEOUT;
        self.has_gateway && self.discard(end).unwrap_or(false) && self.drain().is_ok()
    }

    /// Makes sure that the next reply belongs to the next request. Does nothing on a line in sync.
    /// [`LinkError::Lost`] after several attempts, [`LinkError::Broken`] when the port is broken.
    pub fn synchronise(&mut self) -> Result<(), LinkError> {
        let end = self.transport.now() + GATEWAY_TIMEOUT;
        let mut attempts = 0;
        while !self.is_in_sync() {
            let may_wait = self.has_gateway && self.transport.now() < end;
            if attempts >= ATTEMPTS && !may_wait {
                return Err(LinkError::Lost(self.unexpected()));
            }
            self.try_to_synchronise()?;
            attempts += 1;
        }
        Ok(())
    }

    /// One attempt, which sets [`DriveLink::is_in_sync`]. Fails with [`LinkError::Broken`] only.
    pub(crate) fn try_to_synchronise(&mut self) -> Result<(), LinkError> {
        self.lose_sync(0);
        match self.probe() {
            Ok(true) => (self.sync, self.has_timed_out) = (SyncState::InSync, false),
            Ok(false) | Err(TransferError::Refused(_) | TransferError::Disturbed) => {}
            Err(TransferError::Timeout) => self.wait_for_frame_timeout()?,
            Err(TransferError::NotOurTurn) => return Err(LinkError::NotOurTurn),
            Err(TransferError::Broken(kind)) => {
                self.broken = true;
                return Err(LinkError::Broken(kind));
            }
        }
        Ok(())
    }

    /// Reads the known constants; `true` when all answers match.
    fn probe(&mut self) -> Result<bool, TransferError> {
        if !self.drain()? || !self.reads_as(object::VENDOR, object::MAXON)? {
            return Ok(false);
        }
        match (self.serial_number, self.sync) {
            (Some(serial_number), SyncState::OutOfSync { late }) => {
                for _ in 0..late {
                    if !self.reads_as(object::SERIAL_NUMBER, serial_number)? {
                        return Ok(false);
                    }
                }
                Ok(true)
            }
            // With one constant only, silence must show that no reply is on its way.
            _ => Ok(!self.discard(self.transport.now() + QUIET)?),
        }
    }

    fn reads_as(&mut self, object: Object<u32>, known: u32) -> Result<bool, TransferError> {
        let commands = self.family.command_set();
        let request = commands.read(LOCAL_NODE, object.address());
        let address = object.address();
        let reply = self.attempt(&request, &mut |reply| commands.read_reply(reply, address))?;
        Ok(reply.value == known)
    }

    /// Discards bytes until the line is quiet; `false` if it never is.
    fn drain(&mut self) -> io::Result<bool> {
        let end = self.transport.now() + MAX_NOISE;
        while self.discard(self.transport.now() + QUIET)? {
            if self.transport.now() > end {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Discards all bytes for the frame timeout: a drive that waits for the rest of a request
    /// forgets the request. A gateway that answers at last does not wait for anything.
    fn wait_for_frame_timeout(&mut self) -> Result<(), LinkError> {
        let until = self.transport.now() + self.frame_timeout;
        while self.transport.now() < until {
            let answers = self.discard(until).map_err(LinkError::broken)?;
            if answers && self.has_gateway {
                break;
            }
        }
        Ok(())
    }

    /// Discards bytes that have arrived or arrive until `deadline`; `true` if there were any.
    fn discard(&mut self, deadline: Nanos) -> io::Result<bool> {
        let mut discarded = [0; CHUNK];
        let count = self.receive(&mut discarded, deadline)?;
        for &byte in discarded.iter().take(count) {
            if let ParserEvent::Frame(frame) = self.parser.push(byte)
                && self.has_timed_out
            {
                self.unexpected.note_frame(&frame, true);
            }
        }
        Ok(count > 0)
    }
}
