//! maxon drives over serial lines.
//!
//! Everything here speaks in drive terms: counts, objects, statuswords. It knows no model and no
//! angle.
//!
//! | file | holds |
//! |---|---|
//! | `frame` | the V2 frame: stuffing, CRC, parser that resynchronises; bytes in, bytes out |
//! | `object` | the objects of the drive that we use: index, subindex, size, sign |
//! | `request` | requests, and the reasons that drives give for refusing |
//! | `cia402` | controlword, statusword, the states and the way between them |
//! | `handshake` | the V1 frame of EPOS2 on RS232: a byte of hand-shake for every part |
//! | `dialect` | how a family is asked: opcodes, order of the parameters |
//! | `family` | what the port thread needs to know of a family of drives |
//! | `epos4`, `epos2` | the families: requests, objects, settings, error codes; sans I/O |
//! | `transport`, `serial` | the line and its clock; a serial port as a line |
//! | `histogram` | how long round trips take |
//! | `exchange` | one request, one reply, and getting back in step when the reply does not come |
//! | `hint` | where axes stood when the controller ended |
//! | `inspect` | looking at drives without touching them |
//! | `bring_up`, `port` | from a device file to drives that are known, switched off and limited |
//! | `axis` | one axis as a state machine without I/O |
//! | `runner` | the thread that owns a serial port |
//! | `error`, `event` | what can go wrong, and what is reported |

mod axis;
pub mod bring_up;
pub mod cia402;
pub mod dialect;
pub mod epos2;
pub mod epos4;
pub mod error;
pub mod event;
pub mod exchange;
pub mod family;
pub mod frame;
pub mod handshake;
mod hint;
pub mod histogram;
pub mod inspect;
pub mod object;
pub mod port;
pub mod request;
pub mod runner;
pub mod serial;
pub mod transport;

pub use bring_up::AxisIdentity;
pub use error::DriveError;
pub use event::{PortEvent, PortEventKind};
pub use family::Drive;
pub use histogram::Histogram;
pub use port::{Configured, Identified, Opened, Port};
pub use runner::{AxisLink, PortRunner};

use serde::{Deserialize, Serialize};

use crate::units::{Counts, Nanos};

/// What the control loop wants of one drive. The newest request replaces the former ones; nothing
/// queues.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct AxisRequest {
    /// Counts up by one every tick.
    pub sequence: u64,
    /// The state that the drive should be brought to and kept in.
    pub demand: Demand,
    /// The set-point. Written only in [`Demand::Enabled`], and only once the drive is enabled on
    /// its own position.
    pub target: Counts,
    /// Counts up by one for every fault reset that the operator acknowledged.
    pub fault_resets: u32,
    /// Counts up by one for every homing that the operator asked for.
    pub homings: u32,
    /// Stamp and sequence of the command that the target comes from, carried along to measure
    /// latency. Zero: none.
    pub command_stamp: Nanos,
    /// See `command_stamp`.
    pub command_sequence: u64,
}

/// The state that a drive should be brought to. In doubt: [`Demand::Disabled`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Demand {
    /// Power stage off, reached in order: operation disabled, then shut down.
    #[default]
    Disabled,
    /// Operation enabled in cyclic synchronous position mode, following the target.
    Enabled,
    /// Quick-stop ramp, then powered and holding.
    QuickStop,
}

/// What one drive reports, as far as the newest replies tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct AxisFeedback {
    /// Counts up by one with every position read.
    pub sequence: u64,
    /// When the reply with `position` arrived. Zero: never.
    pub stamp: Nanos,
    /// Encoder position (0x6064).
    pub position: Counts,
    /// Where the drive stands in its state machine.
    pub phase: AxisPhase,
    /// The position that the drive refers to was set by homing (statusword bit 15).
    pub homed: bool,
    /// The last set-point that was written and acknowledged.
    pub written: Option<WrittenTarget>,
    /// Statusword (0x6041) as read.
    pub statusword: u16,
    /// Error code (0x603F; EPOS2 0x1003:01, in a fault only) as read; 0 = none.
    pub error_code: u16,
    /// Motor current (0x30D1:02; EPOS2 0x6078), mA.
    pub current_ma: i32,
    /// The last fault reset that was carried out, as counted in [`AxisRequest::fault_resets`].
    pub fault_resets: u32,
    /// The last homing that ended, well or not, as counted in [`AxisRequest::homings`].
    pub homings: u32,
    /// Lifetime counters of the line.
    pub counters: LinkCounters,
}

/// A set-point that reached the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct WrittenTarget {
    /// The set-point.
    pub target: Counts,
    /// When the last byte of the request had been handed to the operating system.
    pub stamp: Nanos,
    /// [`AxisRequest::sequence`] of the request that was written.
    pub sequence: u64,
    /// [`AxisRequest::command_stamp`] of that request.
    pub command_stamp: Nanos,
    /// [`AxisRequest::command_sequence`] of that request.
    pub command_sequence: u64,
}

/// Where the driver and the drive stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum AxisPhase {
    /// Not identified or not configured yet.
    #[default]
    Starting,
    /// Configured, power stage off.
    Disabled,
    /// On the way to enabled: target preloaded and read back, states stepped through.
    Enabling,
    /// Operation enabled; the target is followed.
    Enabled,
    /// The drive is looking for its zero.
    Homing,
    /// Quick stop active: powered, holding, deaf to targets.
    QuickStopped,
    /// On the way to disabled.
    Disabling,
    /// The drive reports a fault; see the error code.
    Faulted,
    /// The line does not answer, or the drive is not the one that was configured.
    Lost,
}

/// Lifetime counters of one serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LinkCounters {
    /// Requests that were answered.
    pub exchanges: u64,
    /// Requests that were not answered in time.
    pub timeouts: u64,
    /// Replies with a wrong CRC.
    pub crc_errors: u64,
    /// Times the parser had to look for the start of a frame.
    pub resynchronisations: u64,
    /// Requests that were sent again.
    pub retries: u64,
    /// From the first byte of a request to the last of its reply. No decision hangs on it, so no
    /// black box keeps it.
    #[serde(skip)]
    pub round_trips: Histogram,
}
