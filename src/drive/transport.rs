//! The line to the drives, and the clock that times it.

use std::io;

use crate::units::Nanos;

/// A line that carries bytes both ways, with its clock.
///
/// The clock belongs to the line so that a simulated line can run in simulated time: everything
/// above is then exact and takes no real time in tests.
pub trait Transport {
    /// Hands all bytes to the line in one call: on USB every call costs a packet.
    ///
    /// # Errors
    ///
    /// When the line is broken. Bytes that only wait to be sent are no error.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Takes what has arrived, waiting for the first byte until `deadline`. 0 bytes: nothing came.
    /// What has arrived by the time of the call is returned even if the deadline has passed.
    ///
    /// # Errors
    ///
    /// When the line is broken.
    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize>;

    /// Opens a line anew that broke: the cable may be back, with another device behind the same
    /// name. Used on a line that is lost, so it may take its time. A line that cannot break has
    /// nothing to do.
    ///
    /// # Errors
    ///
    /// When it is still broken.
    fn reopen(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// The present instant.
    fn now(&self) -> Nanos;

    /// Sleeps until an instant, or not at all if it has passed.
    fn sleep_until(&mut self, until: Nanos);
}
