//! maxon drives over serial lines.
//!
//! This module works in drive terms: counts, objects, statuswords. It uses no models and no angles.
//!
//! | file | contents |
//! |---|---|
//! | `serial_frame` | the V2 frame: stuffing, CRC, encoder, parser |
//! | `dictionary` | objects, error codes and states of drives |
//! | `families` | EPOS4 and EPOS2 |
//! | `line` | a serial port, and one request and its reply over it |
//! | `capture` | the bytes of the last minute on a line, and their file |
//! | `ports` | opening ports; identifying, reading and stopping drives |
//! | `axis` | one axis as a state machine without I/O |
//! | `port_runner` | the thread that owns a serial port |
//! | `error`, `event` | errors, and the received bytes in them; events |

mod axis;
pub mod capture;
mod dictionary;
pub mod error;
pub mod event;
mod families;
mod line;
pub(crate) mod port_runner;
mod ports;
pub mod serial_frame;

pub use crate::robot::AxisPhase;
pub use axis::interface::{AxisFeedback, AxisRequest, Demand, WrittenTarget};
pub use bring_up::AxisIdentity;
pub use dictionary::{cia402, drive_fault, object, objects};
pub use error::DriveError;
pub use event::{PortEvent, PortEventKind};
pub use families::{command_set, epos4, family_selection};
use families::{epos2, family};
pub use family::DriveFamily;
pub(crate) use line::line_turn;
pub use line::{latency_timer, link, serial_transport, transport};
pub use link::LinkCounters;
pub use port::{Port, ReadyPort};
pub use port_runner::{AxisLink, PortRequest, PortRunner};
pub(crate) use ports::port;
pub use ports::{bring_up, fingerprint, inspect, quick_stop, survey};
