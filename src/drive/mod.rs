//! maxon drives over serial lines.
//!
//! This module works in drive terms: counts, objects, statuswords. It uses no models and no angles.
//!
//! | file | contents |
//! |---|---|
//! | `serial_frame`, `serial_frame_parser` | the V2 frame: stuffing, CRC, encoder; its parser |
//! | `objects` | the single table of dictionary objects: type, access, range, firmware |
//! | `object` | the objects that the driver uses, with their types in Rust |
//! | `command_set`, `abort_code` | requests and replies; reasons of a refusal |
//! | `cia402` | controlword, statusword, states, and the commands that lead to a state |
//! | `family`, `family_selection` | what differs between families of drives; the supported ones |
//! | `epos4`, `epos2` | the families: command set, objects, settings |
//! | `drive_fault`, `homing_plan` | meaning of error codes (`error_codes.md`); method and settings of homing |
//! | `transport`, `serial_transport` | the line and its clock; a serial port as a line |
//! | `line_turn` | whose turn it is on a line: that of the controller or of the watchdog |
//! | `latency_timer` | the timer of FTDI adapters that delays replies |
//! | `link` | one request, one reply, retries, and synchronising the line; its replay |
//! | `capture` | the bytes of the last minute on a line, and their file |
//! | `unexpected_reply` | bytes received instead of a valid reply, for messages |
//! | `variant` | what a model or a firmware lacks or limits, in words |
//! | `quick_stop` | stops drives from outside the controller |
//! | `bring_up`, `port` | from a device file to drives that are identified, off and limited |
//! | `saved_position` | positions of the axes between two runs of the controller |
//! | `fingerprint` | every setting of a drive, read and compared |
//! | `inspect` | reading the state of drives without changing it |
//! | `survey` | search for drives: the rate, and the nodes of a port |
//! | `axis` | one axis as a state machine without I/O |
//! | `port_runner` | the thread that owns a serial port |
//! | `request_watchdog` | notices a control loop that sends no requests |
//! | `error`, `event` | errors and events |

pub mod abort_code;
pub mod axis;
pub mod bring_up;
pub mod capture;
pub mod cia402;
pub mod command_set;
pub mod drive_fault;
pub mod epos2;
pub mod epos4;
pub mod error;
pub mod event;
pub mod family;
pub mod family_selection;
pub mod fingerprint;
pub mod homing_plan;
pub mod inspect;
pub mod latency_timer;
pub mod line_turn;
pub mod link;
pub mod object;
pub mod objects;
pub mod port;
pub mod port_runner;
pub mod quick_stop;
mod request_watchdog;
mod saved_position;
pub mod serial_frame;
pub mod serial_frame_parser;
pub mod serial_transport;
pub mod survey;
pub mod transport;
pub mod unexpected_reply;
pub mod variant;

pub use crate::robot::AxisPhase;
pub use axis::interface::{AxisFeedback, AxisRequest, Demand, WrittenTarget};
pub use bring_up::AxisIdentity;
pub use error::DriveError;
pub use event::{PortEvent, PortEventKind};
pub use family::DriveFamily;
pub use link::LinkCounters;
pub use port::{Configured, Identified, Opened, Port};
pub use port_runner::{AxisLink, PortRequest, PortRunner};
