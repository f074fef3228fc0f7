//! The line to the drives, and its clock.

use std::io;

use super::capture::Outcome;
use crate::units::Nanos;

/// A line that carries bytes both ways, with its clock.
///
/// The clock belongs to the line so that a simulated line can run in simulated time: tests are then
/// exact and fast.
pub trait Transport {
    /// Hands all bytes to the line in one call: on USB every call costs a packet.
    ///
    /// # Errors
    ///
    /// When the line is broken. Bytes that wait to be sent are no error.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Reads the bytes that have arrived, and waits for the first one until `deadline`. 0: none
    /// came. Bytes that have arrived are returned even if the deadline has passed.
    ///
    /// # Errors
    ///
    /// When the line is broken.
    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize>;

    /// Reopens a broken line: the cable may be plugged in again, with another device behind the
    /// same name. May block. A line that cannot break has nothing to do.
    ///
    /// # Errors
    ///
    /// When it is still broken.
    fn reopen(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// Does what has to be done from time to time between exchanges. Must not block.
    fn maintain(&mut self) {}

    /// Takes note of how an attempt ended, if somebody wants to know.
    fn note(&mut self, _outcome: Outcome) {}

    /// The present instant.
    fn now(&self) -> Nanos;

    /// Sleeps until an instant, or not at all if it has passed.
    fn sleep_until(&mut self, until: Nanos);
}
