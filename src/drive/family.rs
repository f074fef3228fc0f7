//! What the port thread needs to know of a family of drives, and nothing more.

use std::fmt;

use crate::config::AxisConfig;

use super::frame::Frame;
use super::object::{Address, Object, Setting};
use super::request::{ReplyError, Request};

/// A family of drives: how it is spoken to, and which of its objects plays which part.
///
/// Implementations are constants without state; everything that changes lives in the port thread.
pub trait Drive: fmt::Debug + Sync {
    /// Name for messages.
    fn name(&self) -> &'static str;

    /// Asks for the value of an object of at most four bytes.
    fn read(&self, node: u8, object: Address) -> Request;

    /// Sets an object of at most four bytes.
    fn write(&self, node: u8, setting: Setting) -> Request;

    /// The four bytes in the reply to [`Drive::read`]; cut them to the size of the object.
    ///
    /// # Errors
    ///
    /// When the drive refused, or the frame is no reply to a read.
    fn read_reply(&self, reply: Frame<'_>) -> Result<u32, ReplyError>;

    /// Judges the reply to [`Drive::write`].
    ///
    /// # Errors
    ///
    /// When the drive refused, or the frame is no reply to a write.
    fn write_reply(&self, reply: Frame<'_>) -> Result<(), ReplyError>;

    /// Starts to read an object of any length. Used at start only: it allocates.
    fn read_long(&self, node: u8, object: Address) -> Box<dyn LongRead>;

    /// Which object plays which part.
    fn parts(&self) -> &'static Parts;

    /// The limits and options of an axis: written at start, read back and compared.
    fn settings(&self, axis: &AxisConfig) -> Vec<Setting>;

    /// What an error code (`Parts::error_code`) means.
    fn fault(&self, code: u16) -> Fault;
}

/// A read that takes several requests.
pub trait LongRead {
    /// The next request.
    fn request(&self) -> Request;

    /// Takes the reply; `true` when the value is complete.
    ///
    /// # Errors
    ///
    /// When the drive refused, or the frame is no reply to the request.
    fn take(&mut self, reply: Frame<'_>) -> Result<bool, ReplyError>;

    /// The bytes read so far.
    fn bytes(&self) -> &[u8];
}

/// Which object plays which part in a family.
#[derive(Debug, Clone, Copy)]
pub struct Parts {
    /// The vendor of the drive, and its number: a known constant.
    pub vendor: Object<u32>,
    /// See `vendor`.
    pub vendor_number: u32,
    /// Product code.
    pub product: Object<u32>,
    /// Revision, with the firmware version in its high word.
    pub revision: Object<u32>,
    /// Serial number.
    pub serial_number: Object<u32>,
    /// Full serial number, 8 bytes; `None` if the family has none.
    pub full_serial_number: Option<Address>,
    /// Device name.
    pub device_name: Address,
    /// How long the drive waits for the rest of a frame, per interface, ms.
    pub frame_timeouts: &'static [Object<u16>],
    /// Commands to the state machine.
    pub controlword: Object<u16>,
    /// State of the state machine.
    pub statusword: Object<u16>,
    /// Mode of operation.
    pub mode: Object<i8>,
    /// Mode of operation in force.
    pub mode_display: Object<i8>,
    /// The mode in which every set-point acts at once.
    pub streaming_mode: i8,
    /// The mode in which the drive looks for its zero.
    pub homing_mode: i8,
    /// How homing finds the zero.
    pub homing_method: Object<i8>,
    /// The method that takes the present position as zero.
    pub home_is_here: i8,
    /// Set-point in `streaming_mode`, counts.
    pub target: Object<i32>,
    /// Lowest position that the drive goes to, counts; one of [`Drive::settings`].
    pub position_min: Object<i32>,
    /// Highest position that the drive goes to, counts; one of [`Drive::settings`].
    pub position_max: Object<i32>,
    /// Encoder position, counts.
    pub position: Object<i32>,
    /// The last error.
    pub error_code: Object<u16>,
    /// Motor current, mA.
    pub current: Object<i32>,
}

/// What an error code means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// The code.
    pub code: u16,
    /// Its name.
    pub name: &'static str,
    /// What the drive does about it.
    pub reaction: Reaction,
    /// Resetting it clears the position: the axis must be homed again.
    pub clears_position: bool,
}

/// What a drive does about a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reaction {
    /// Power off at once, without a controlled stop.
    Off,
    /// As the fault-reaction option says: quick-stop ramp, then off.
    Ramp,
    /// As the abort-connection option says.
    ConnectionLost,
    /// Nothing: a warning.
    Warning,
    /// Not known for this code.
    Unknown,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} ({})", self.code, self.name)?;
        if self.clears_position { write!(f, ", the position is lost: home the axis") } else { Ok(()) }
    }
}
