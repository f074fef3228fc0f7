//! One request, one reply, and what is done when the reply does not come.
//!
//! | word | meaning |
//! |---|---|
//! | attempt | a request that is sent once, and the wait for its reply |
//! | exchange | an attempt, and a second one if the first failed and the request may be repeated |
//! | in step | the next reply belongs to the next request |
//!
//! Replies carry neither an index nor a number: a late one looks like the answer to the next
//! request. So a failed attempt puts the line *out of step*, and no reply is believed until `step`
//! has put it in step again.

mod attempt;
mod shake;
mod step;

use crate::config::{Framing, PortConfig};
use crate::units::Nanos;

use super::LinkCounters;
use super::dialect::LongRead;
use super::error::LinkError;
use super::family::Drive;
use super::frame::{Encoder, Frame, Parser};
use super::object::{Address, Object, Setting, Value};
use super::request::{AbortCode, ReplyError, Request};
use super::transport::Transport;

use attempt::Miss;
use step::Standing;

/// Frame time-out of drives as they are delivered (0x2005, 0x2006).
const DEFAULT_FRAME_TIMEOUT: Nanos = Nanos::from_millis(500);

/// The node that the port belongs to, whatever its own id.
pub(super) const LOCAL_NODE: u8 = 0;

/// Whether a request may be sent again when its reply did not come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repeat {
    /// Reads, and writes of the same value: doing it twice is doing it once.
    Safe,
    /// Edges that start something, and set-points, which are replaced by newer ones instead.
    Never,
}

/// A reply with its times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answer<R> {
    /// What it says.
    pub value: R,
    /// When the last byte of the request had been handed over.
    pub sent: Nanos,
    /// When the last byte of the reply had been read.
    pub received: Nanos,
}

/// A line with the drives behind it: one exchange at a time.
#[derive(Debug)]
pub struct Link<T> {
    transport: T,
    drive: &'static dyn Drive,
    framing: Framing,
    encoder: Encoder,
    parser: Parser,
    standing: Standing,
    reply_timeout: Nanos,
    byte_time: Nanos,
    frame_timeout: Nanos,
    serial_number: Option<u32>,
    broken: bool,
    counters: LinkCounters,
}

impl<T: Transport> Link<T> {
    /// A line that nothing is known about yet.
    pub fn new(transport: T, drive: &'static dyn Drive, config: &PortConfig) -> Self {
        // A start bit, eight data bits and a stop bit.
        let byte_time = Nanos(10 * 1_000_000_000 / u64::from(config.baud.max(1)));
        Self {
            transport,
            drive,
            framing: config.framing,
            encoder: Encoder::default(),
            parser: Parser::default(),
            standing: Standing::InStep,
            reply_timeout: Nanos::from_millis(config.reply_timeout_ms),
            byte_time,
            frame_timeout: DEFAULT_FRAME_TIMEOUT,
            serial_number: None,
            broken: false,
            counters: LinkCounters::default(),
        }
    }

    /// The drive that the port belongs to: its dialect is spoken.
    pub fn drive(&self) -> &'static dyn Drive {
        self.drive
    }

    /// The line's clock.
    pub fn now(&self) -> Nanos {
        self.transport.now()
    }

    /// Sleeps on the line's clock.
    pub fn sleep_until(&mut self, until: Nanos) {
        self.transport.sleep_until(until);
    }

    /// The port reported itself broken, and has not been opened anew.
    pub fn is_broken(&self) -> bool {
        self.broken
    }

    /// Opens a broken port anew.
    ///
    /// # Errors
    ///
    /// When it is still broken.
    pub fn reopen(&mut self) -> Result<(), LinkError> {
        self.transport
            .reopen()
            .map_err(|error| LinkError::Broken(error.kind()))?;
        self.broken = false;
        Ok(())
    }

    /// Lifetime counters.
    pub fn counters(&self) -> LinkCounters {
        self.counters
    }

    /// The serial number of the drive that the port belongs to: the second known constant.
    pub fn know_serial_number(&mut self, serial_number: u32) {
        self.serial_number = Some(serial_number);
    }

    /// How long the drive waits for the rest of a damaged request: the silence that frees it.
    pub fn know_frame_timeout(&mut self, timeout: Nanos) {
        self.frame_timeout = timeout;
    }

    /// Nothing is known about the drive any more: it may have been replaced or restarted.
    pub fn forget_drive(&mut self) {
        self.serial_number = None;
        self.frame_timeout = DEFAULT_FRAME_TIMEOUT;
    }

    /// Reads an object.
    ///
    /// # Errors
    ///
    /// See [`LinkError`].
    pub fn read<V: Value>(&mut self, node: u8, object: Object<V>) -> Result<V, LinkError> {
        self.read_raw(node, object.address())
            .map(|answer| V::from_raw(answer.value))
    }

    /// Reads an object as four bytes, cut to its size.
    ///
    /// # Errors
    ///
    /// See [`LinkError`].
    pub fn read_raw(&mut self, node: u8, object: Address) -> Result<Answer<u32>, LinkError> {
        let dialect = self.drive.dialect();
        let request = dialect.read(node, object);
        self.exchange(&request, Repeat::Safe, &mut |reply| {
            dialect.read_reply(reply).map(|raw| object.cut(raw))
        })
    }

    /// Writes an object.
    ///
    /// # Errors
    ///
    /// See [`LinkError`]. [`LinkError::Unanswered`] leaves open whether the drive took the value.
    pub fn write(
        &mut self,
        node: u8,
        setting: Setting,
        repeat: Repeat,
    ) -> Result<Answer<()>, LinkError> {
        let dialect = self.drive.dialect();
        let request = dialect.write(node, setting);
        self.exchange(&request, repeat, &mut |reply| dialect.write_reply(reply))
    }

    /// Reads an object of any length. Allocates.
    ///
    /// # Errors
    ///
    /// See [`LinkError`].
    pub fn read_long(&mut self, node: u8, object: Address) -> Result<Box<dyn LongRead>, LinkError> {
        let mut read = self.drive.dialect().read_long(node, object);
        self.get_in_step()?;
        loop {
            let request = read.request();
            if self
                .exchange(&request, Repeat::Never, &mut |reply| read.take(reply))?
                .value
            {
                return Ok(read);
            }
        }
    }

    fn exchange<R>(
        &mut self,
        request: &Request,
        repeat: Repeat,
        decode: &mut dyn FnMut(Frame<'_>) -> Result<R, ReplyError>,
    ) -> Result<Answer<R>, LinkError> {
        self.notice_strays()?;
        if !self.is_in_step() {
            self.get_in_step()?;
            if repeat == Repeat::Never {
                // That took time, and what may not be repeated may not be late either.
                return Err(LinkError::Unanswered);
            }
        }
        match (self.attempt(request, decode), repeat) {
            (Ok(answer), _) => return Ok(answer),
            (Err(Miss::Broken(kind)), _) => return Err(LinkError::Broken(kind)),
            (Err(Miss::Refused(code)), _) if code != AbortCode::CRC => {
                return Err(LinkError::Refused(code));
            }
            (Err(Miss::Refused(code)), Repeat::Never) => return Err(LinkError::Refused(code)),
            (Err(Miss::Silent | Miss::Disturbed), Repeat::Never) => {
                return self.get_in_step().and(Err(LinkError::Unanswered));
            }
            (Err(Miss::Refused(_) | Miss::Silent | Miss::Disturbed), Repeat::Safe) => {}
        }
        self.get_in_step()?;
        self.counters.retries += 1;
        match self.attempt(request, decode) {
            Ok(answer) => Ok(answer),
            Err(Miss::Broken(kind)) => Err(LinkError::Broken(kind)),
            Err(Miss::Refused(code)) => Err(LinkError::Refused(code)),
            Err(Miss::Silent | Miss::Disturbed) => {
                self.get_in_step().and(Err(LinkError::Unanswered))
            }
        }
    }
}
