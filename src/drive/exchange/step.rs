//! Getting in step: making sure that the next reply belongs to the next request.
//!
//! The line is drained until it is quiet, the parser is reset, and constants whose values are known
//! are read and compared: the vendor number once, then the serial number. Late replies can
//! interfere only as follows. The drive answers in the order of the requests, and at most once
//! each. So if late replies are still on their way, the answers to these reads arrive behind them,
//! shifted by their number `d`. The word "vendor, serial, serial, ..." of length `n` does not agree
//! with itself shifted by any `d < n`, because the vendor stands only at its start. And `d` is at
//! most the number of requests that were not answered. With one read more than that, a shifted line
//! is always noticed.

use std::io;

use super::attempt::Miss;
use super::{LOCAL_NODE, Link};
use crate::config::Framing;
use crate::drive::error::LinkError;
use crate::drive::object::Address;
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// The line counts as quiet after this long without a byte: several times the gap that USB adapters
/// leave between the parts of one reply.
const QUIET: Nanos = Nanos::from_millis(5);

/// A line that is not quiet for this long is not talking to us.
const BABBLE: Nanos = Nanos::from_millis(100);

/// Tries to get in step before the line is given up.
const TRIES: u32 = 4;

/// The most late replies that are reckoned with. More than this happens only on a line that was
/// given up, and a drive that comes back from there is brought up again from the start.
const MOST_LATE: u32 = 16;

/// Bytes dropped at a time.
const CHUNK: usize = 64;

/// Whether the next reply can be believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standing {
    /// Every request was answered, and nothing else arrived.
    InStep,
    /// So many replies may still be on their way, at least one.
    OutOfStep { late: u32 },
}

impl<T: Transport> Link<T> {
    /// The line is in step.
    pub fn is_in_step(&self) -> bool {
        self.standing == Standing::InStep
    }

    /// A request was not answered (`unanswered` is 1), or something arrived that is no answer (0).
    pub(super) fn fall_out_of_step(&mut self, unanswered: u32) {
        let late = match self.standing {
            Standing::InStep => 0,
            Standing::OutOfStep { late } => late,
        };
        self.standing = Standing::OutOfStep {
            late: (late + unanswered).clamp(1, MOST_LATE),
        };
    }

    /// Bytes that arrive unasked mean that some reply is out of step.
    pub(super) fn notice_strays(&mut self) -> Result<(), LinkError> {
        let now = self.transport.now();
        let stray = self.discard(now);
        self.broken |= stray.is_err();
        if stray.map_err(broken)? {
            self.counters.resynchronisations += 1;
            self.fall_out_of_step(0);
        }
        Ok(())
    }

    /// Drops what arrives until the line is quiet, or does not become so.
    ///
    /// # Errors
    ///
    /// [`LinkError::Broken`] only.
    pub fn wait_for_quiet(&mut self) -> Result<(), LinkError> {
        self.drain().map(|_| ()).map_err(broken)
    }

    /// Makes sure that the next reply belongs to the next request. Does nothing on a line that is
    /// in step.
    ///
    /// # Errors
    ///
    /// When that was tried in vain, or the port is broken.
    pub fn get_in_step(&mut self) -> Result<(), LinkError> {
        for _ in 0..TRIES {
            if self.is_in_step() {
                return Ok(());
            }
            self.try_to_get_in_step()?;
        }
        if self.is_in_step() {
            Ok(())
        } else {
            Err(LinkError::Lost)
        }
    }

    /// One try to get in step.
    ///
    /// # Errors
    ///
    /// [`LinkError::Broken`] only; whether it worked is told by [`Link::is_in_step`].
    pub fn try_to_get_in_step(&mut self) -> Result<(), LinkError> {
        self.fall_out_of_step(0);
        if self.framing == Framing::V1 {
            // The drive may be waiting for any part of an exchange, and would take an opcode for
            // it: it forgets the exchange after this silence.
            self.discard_until(self.transport.now() + self.frame_timeout)
                .map_err(broken)?;
        }
        match self.probe() {
            Ok(true) => self.standing = Standing::InStep,
            Ok(false) | Err(Miss::Refused(_) | Miss::Disturbed) => {}
            Err(Miss::Silent) if self.framing == Framing::V1 => {}
            Err(Miss::Silent) => {
                // A drive that holds half a request forgets it after this silence.
                self.discard_until(self.transport.now() + self.frame_timeout)
                    .map_err(broken)?;
            }
            Err(Miss::Broken(kind)) => {
                self.broken = true;
                return Err(LinkError::Broken(kind));
            }
        }
        Ok(())
    }

    /// Reads the known constants; `true` when all answers are theirs.
    fn probe(&mut self) -> Result<bool, Miss> {
        if !self.drain()? {
            return Ok(false);
        }
        let parts = self.drive.parts();
        if !self.reads_as(parts.vendor.address(), parts.vendor_number)? {
            return Ok(false);
        }
        match (self.serial_number, self.standing) {
            (Some(serial_number), Standing::OutOfStep { late }) => {
                for _ in 0..late {
                    if !self.reads_as(parts.serial_number.address(), serial_number)? {
                        return Ok(false);
                    }
                }
                Ok(true)
            }
            // With one constant alone, silence has to tell that nothing is on its way.
            _ => Ok(!self.discard(self.transport.now() + QUIET)?),
        }
    }

    fn reads_as(&mut self, object: Address, known: u32) -> Result<bool, Miss> {
        let dialect = self.drive.dialect();
        let request = dialect.read(LOCAL_NODE, object);
        Ok(self
            .attempt(&request, &mut |reply| dialect.read_reply(reply))?
            .value
            == known)
    }

    /// Drops what arrives until the line is quiet; `false` if it never is.
    fn drain(&mut self) -> io::Result<bool> {
        let end = self.transport.now() + BABBLE;
        while self.discard(self.transport.now() + QUIET)? {
            if self.transport.now() > end {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Drops everything that arrives until an instant.
    fn discard_until(&mut self, until: Nanos) -> io::Result<()> {
        while self.transport.now() < until {
            self.discard(until)?;
        }
        Ok(())
    }

    /// Drops what has arrived, waiting for it until `deadline`; `true` if there was something.
    fn discard(&mut self, deadline: Nanos) -> io::Result<bool> {
        let mut dropped = [0; CHUNK];
        Ok(self.transport.read(&mut dropped, deadline)? > 0)
    }
}

fn broken(error: io::Error) -> LinkError {
    LinkError::Broken(error.kind())
}
