//! A line of drives: one request, one reply, and the handling of a missing reply.
//!
//! | term | meaning |
//! |---|---|
//! | attempt | a request that is sent once, and the wait for its reply |
//! | exchange | an attempt, and a second one if the first failed and the request may be retried |
//! | in sync | the next reply belongs to the next request |
//!
//! Replies carry neither an index nor a sequence number: a late reply looks like the answer to the
//! next request. So a failed attempt puts the line out of sync, and no reply is trusted until
//! `link::attempt` has synchronised the line again.

mod attempt;
pub mod replay;

use std::io;

use serde::{Deserialize, Serialize};

use crate::config::PortConfig;
use crate::drive::command_set::{DriveRequest, ReplyError, SegmentedRead};
use crate::drive::error::{LinkError, UnexpectedReply};
use crate::drive::family::DriveFamily;
use crate::drive::object::{AbortCode, Address, Object, Setting, Value};
use crate::drive::serial_frame::{FrameEncoder, FrameParser, SerialFrame};
use crate::drive::transport::{NOT_OUR_TURN, Transport};
use crate::units::Nanos;

/// Frame timeout of drives as delivered (0x2005, 0x2006).
const DEFAULT_FRAME_TIMEOUT: Nanos = Nanos::from_millis(500);

/// Maximum time that a gateway waits for a node. It accepts nothing else during the wait, then
/// answers in place of the node.
pub(in crate::drive) const GATEWAY_TIMEOUT: Nanos = Nanos::from_millis(600);

/// The node that the port belongs to, whatever its own id.
pub(in crate::drive) const LOCAL_NODE: u8 = 0;

/// Lifetime counters of one serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LinkCounters {
    /// Requests that were answered.
    pub exchanges: u64,
    /// Requests that were not answered in time.
    pub timeouts: u64,
    /// Replies with a wrong CRC.
    pub crc_errors: u64,
    /// Times that the parser had to search the start of a frame.
    pub resynchronisations: u64,
    /// Requests that were sent again.
    pub retries: u64,
}

/// Whether a request may be sent again when its reply is missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Retry {
    /// Reads, and writes of the same value: they are idempotent.
    Safe,
    /// The same on a line with a gateway: not after a time-out, because the second attempt may cost
    /// the other nodes another time-out of the gateway.
    IfDamaged,
    /// Edges that start something, and setpoints, which are replaced by newer ones instead.
    Never,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimedReply<R> {
    pub value: R,
    /// When the last byte of the request was handed to the operating system.
    pub sent: Nanos,
    /// When the last byte of the reply was read.
    pub received: Nanos,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TransferError {
    /// The drive refused the request; the line is fine.
    Refused(AbortCode),
    Timeout,
    /// A damaged reply, or a reply to another request.
    Disturbed,
    Broken(io::ErrorKind),
    /// The line now belongs to another process.
    NotOurTurn,
}

impl From<io::Error> for TransferError {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            NOT_OUR_TURN => Self::NotOurTurn,
            kind => Self::Broken(kind),
        }
    }
}

impl From<ReplyError> for TransferError {
    fn from(error: ReplyError) -> Self {
        match error {
            ReplyError::Refused(code) => Self::Refused(code),
            ReplyError::Mismatch => Self::Disturbed,
        }
    }
}

/// Value of a reply, as the capture keeps it: 0 for a write, 1 for the last segment.
type Decode<'a> = &'a mut dyn FnMut(SerialFrame<'_>) -> Result<u32, ReplyError>;

/// Whether the next reply can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SyncState {
    /// Every request was answered. Nothing else arrived.
    InSync,
    /// At most this many late replies may still arrive, at least one.
    OutOfSync { late: u32 },
}

/// A line of drives: one exchange at a time.
#[derive(Debug)]
pub struct DriveLink<T> {
    transport: T,
    family: &'static dyn DriveFamily,
    encoder: FrameEncoder,
    parser: FrameParser,
    sync: SyncState,
    reply_timeout: Nanos,
    usual_reply_timeout: Nanos,
    has_gateway: bool,
    byte_time: Nanos,
    frame_timeout: Nanos,
    serial_number: Option<u32>,
    broken: bool,
    /// A request timed out since the line was in sync: its reply may still come.
    has_timed_out: bool,
    counters: LinkCounters,
    /// Bytes received since the start of the exchange that are not a valid reply.
    unexpected: UnexpectedReply,
}

impl<T: Transport> DriveLink<T> {
    /// A line about which nothing is known yet.
    pub fn new(transport: T, family: &'static dyn DriveFamily, config: &PortConfig) -> Self {
        // A start bit, eight data bits and a stop bit.
        let byte_time = Nanos(10 * 1_000_000_000 / u64::from(config.baud.max(1)));
        let reply_timeout = Nanos::from_millis(config.reply_timeout_ms);
        Self {
            transport,
            family,
            encoder: FrameEncoder::default(),
            parser: FrameParser::default(),
            sync: SyncState::InSync,
            reply_timeout,
            usual_reply_timeout: reply_timeout,
            has_gateway: config.axes.len() > 1,
            byte_time,
            frame_timeout: DEFAULT_FRAME_TIMEOUT,
            serial_number: None,
            broken: false,
            has_timed_out: false,
            counters: LinkCounters::default(),
            unexpected: UnexpectedReply::none_from(family.name()),
        }
    }

    /// The family of the drive that the port belongs to: its command set is used on the line.
    pub fn family(&self) -> &'static dyn DriveFamily {
        self.family
    }

    pub fn now(&self) -> Nanos {
        self.transport.now()
    }

    pub fn sleep_until(&mut self, until: Nanos) {
        self.transport.sleep_until(until);
    }

    /// The port reported an error, and has not been reopened.
    pub fn is_broken(&self) -> bool {
        self.broken
    }

    /// Reopens a broken port. Fails when it is still broken.
    pub fn reopen(&mut self) -> Result<(), LinkError> {
        self.transport.reopen().map_err(LinkError::broken)?;
        self.broken = false;
        Ok(())
    }

    pub(crate) fn is_our_turn(&mut self) -> bool {
        self.transport.is_our_turn()
    }

    /// Waits for replies as long as a gateway may wait for a node, or for the usual time again.
    pub(in crate::drive) fn wait_for_gateway(&mut self, waits: bool) {
        let usual = self.usual_reply_timeout;
        self.reply_timeout =
            if waits && self.has_gateway { usual.max(GATEWAY_TIMEOUT) } else { usual };
    }

    /// Waits for replies for no longer than this, until [`Self::wait_for_gateway`].
    pub(in crate::drive) fn wait_at_most(&mut self, longest: Nanos) {
        self.reply_timeout = self.usual_reply_timeout.min(longest);
    }

    /// How a request is repeated that must not keep the other nodes waiting.
    pub(in crate::drive) fn prompt(&self, retry: Retry) -> Retry {
        if self.has_gateway && retry == Retry::Safe { Retry::IfDamaged } else { retry }
    }

    /// Bytes received since the start of the last exchange that are not a valid reply.
    pub fn unexpected(&self) -> UnexpectedReply {
        if self.unexpected.is_silence() { UnexpectedReply::default() } else { self.unexpected }
    }

    pub fn counters(&self) -> LinkCounters {
        self.counters
    }

    /// The serial number of the drive that the port belongs to: the second known constant.
    pub fn set_serial_number(&mut self, serial_number: u32) {
        self.serial_number = Some(serial_number);
    }

    /// How long the drive waits for the rest of a damaged request before it discards it.
    pub fn set_frame_timeout(&mut self, timeout: Nanos) {
        self.frame_timeout = timeout;
    }

    /// Forgets everything about the drive: it may have been replaced or restarted.
    pub(crate) fn forget_drive(&mut self) {
        self.serial_number = None;
        self.frame_timeout = DEFAULT_FRAME_TIMEOUT;
    }

    pub fn read<V: Value>(&mut self, node: u8, object: Object<V>) -> Result<V, LinkError> {
        let reply = self.read_raw(node, object.address())?;
        Ok(V::from_raw(reply.value))
    }

    /// Reads an object as four bytes, truncated to its size.
    pub fn read_raw(&mut self, node: u8, object: Address) -> Result<TimedReply<u32>, LinkError> {
        self.read_with(node, object, Retry::Safe)
    }

    /// The data of the reply to a read as it came, a refusal as well as a value: for finding out
    /// how a drive answers. Allocates.
    pub fn read_reply_data(&mut self, node: u8, object: Address) -> Result<Vec<u8>, LinkError> {
        let (request, mut data) = (self.family.command_set().read(node, object), Vec::new());
        let mut keep = |reply: SerialFrame<'_>| {
            data = reply.data.to_vec();
            Ok(0)
        };
        self.exchange(&request, Retry::Safe, &mut keep)?;
        Ok(data)
    }

    /// Reads as [`Self::read_raw`], on a line whose other nodes must not wait.
    pub(in crate::drive) fn read_promptly(
        &mut self,
        node: u8,
        object: Address,
    ) -> Result<TimedReply<u32>, LinkError> {
        self.read_with(node, object, self.prompt(Retry::Safe))
    }

    pub(in crate::drive) fn is_answered(&mut self, node: u8, object: Address) -> bool {
        self.read_with(node, object, Retry::Never).is_ok()
    }

    /// Whether a frame comes for a single request, whatever it says. Leaves the line as it is then.
    pub(in crate::drive) fn is_understood(&mut self, node: u8, object: Address) -> bool {
        let request = self.family.command_set().read(node, object);
        let outcome = self.attempt(&request, &mut |_| Ok(0));
        matches!(outcome, Ok(_) | Err(TransferError::Refused(_))) || self.unexpected.is_frame()
    }

    fn read_with(
        &mut self,
        node: u8,
        object: Address,
        retry: Retry,
    ) -> Result<TimedReply<u32>, LinkError> {
        let commands = self.family.command_set();
        self.exchange(&commands.read(node, object), retry, &mut |reply| {
            commands.read_reply(reply, object)
        })
    }

    /// Writes an object. After [`LinkError::Unanswered`] the drive may have taken the value.
    pub fn write(
        &mut self,
        node: u8,
        setting: Setting,
        retry: Retry,
    ) -> Result<TimedReply<()>, LinkError> {
        let commands = self.family.command_set();
        let mut decode = |reply: SerialFrame<'_>| commands.write_reply(reply).map(|()| 0);
        let TimedReply { sent, received, .. } =
            self.exchange(&commands.write(node, setting), retry, &mut decode)?;
        Ok(TimedReply { value: (), sent, received })
    }

    /// Writes an object in one attempt, and leaves the outcome open: whether the next reply is a
    /// good one. Waits for it, but does not synchronise the line if there is none.
    pub(in crate::drive) fn write_unconfirmed(&mut self, node: u8, setting: Setting) -> bool {
        let commands = self.family.command_set();
        let timeouts = self.counters.timeouts;
        let mut decode = |reply: SerialFrame<'_>| commands.write_reply(reply).map(|()| 0);
        let outcome = self.attempt(&commands.write(node, setting), &mut decode);
        if self.counters.timeouts != timeouts && self.reply_timeout >= GATEWAY_TIMEOUT {
            // Nothing answers for as long as a gateway waits: it does not wait now.
            self.wait_for_gateway(false);
        }
        outcome.is_ok()
    }

    /// Reads an object of any length. Allocates.
    pub fn read_segmented(
        &mut self,
        node: u8,
        object: Address,
    ) -> Result<SegmentedRead, LinkError> {
        let mut read = self.family.command_set().read_segmented(node, object);
        self.synchronise()?;
        loop {
            let request = read.request();
            let mut decode = |reply: SerialFrame<'_>| read.take_reply(reply).map(u32::from);
            if self.exchange(&request, Retry::Never, &mut decode)?.value == 1 {
                return Ok(read);
            }
        }
    }

    fn exchange(
        &mut self,
        request: &DriveRequest,
        retry: Retry,
        decode: Decode<'_>,
    ) -> Result<TimedReply<u32>, LinkError> {
        self.unexpected = UnexpectedReply::none_from(self.family.name());
        self.detect_stray_bytes()?;
        if !self.is_in_sync() {
            self.synchronise()?;
            if retry == Retry::Never {
                // Synchronising took time, and a request without retry must not be late either.
                return Err(LinkError::Unanswered(self.unexpected()));
            }
        }
        let error = match self.attempt(request, decode) {
            Ok(reply) => return Ok(reply),
            Err(error) => error,
        };
        // A request that arrived damaged was not carried out.
        let may_retry = !matches!(error, TransferError::Refused(code) if code != AbortCode::CRC)
            && !matches!(error, TransferError::Broken(_) | TransferError::NotOurTurn);
        let is_late = retry == Retry::IfDamaged && error == TransferError::Timeout;
        if retry == Retry::Never || is_late || !may_retry {
            return self.fail(error);
        }
        self.synchronise()?;
        self.counters.retries += 1;
        self.attempt(request, decode).or_else(|error| self.fail(error))
    }

    /// Ends an exchange. After a missing reply the line is synchronised first.
    fn fail<R>(&mut self, error: TransferError) -> Result<R, LinkError> {
        match error {
            TransferError::Refused(code) => Err(LinkError::Refused(code)),
            TransferError::Broken(kind) => Err(LinkError::Broken(kind)),
            TransferError::NotOurTurn => Err(LinkError::NotOurTurn),
            TransferError::Timeout | TransferError::Disturbed => {
                self.synchronise()?;
                Err(LinkError::Unanswered(self.unexpected()))
            }
        }
    }
}
