//! An emulated EPOS4 or EPOS2: object dictionary, state machine, modes of operation, motor. It has
//! no clock and no line: requests and time steps in, replies and motor positions out.
//!
//! Sources: `epos4-serial.md`, sections 1 and 3, which names the clauses of maxon's documents.
//! Where the documents leave something open, the drive does what a careless host handles worst.
//!
//! | file | content |
//! |---|---|
//! | `device` | [`Drive`]: its state, start-up, encoder, snapshot |
//! | `family`, `object_map` | EPOS4 and EPOS2, their modes of operation, and the objects that differ between them |
//! | `abort` | abort codes |
//! | `dictionary` | values of the objects, and the checks on access; types, access and ranges are those of the controller's table of objects, or of a file |
//! | `device_file` | objects of a real drive, as maxon's tool wrote them |
//! | `state` | CiA 402 state machine, and what the drive does with its motor |
//! | `controlword`, `statusword` | what a controlword starts; objects computed when they are read |
//! | `motion` | what modes of operation do in every time step |
//! | `profile`, `motor` | position demand, the motor that follows it, parameters of a drive |
//! | `frame` | the V2 frame, as the drive sees it |
//! | `command_set` | opcodes and their parameters |
//! | `service`, `segmented_transfer` | requests to replies, also of drives behind the one at the port |
//! | `fault`, `event` | fault codes, events for the log |

mod abort;
mod command_set;
mod controlword;
mod device;
mod device_file;
mod dictionary;
pub(crate) mod event;
mod family;
mod fault;
pub mod frame;
mod motion;
mod motor;
mod object_map;
mod profile;
mod segmented_transfer;
mod service;
mod state;
mod statusword;
#[cfg(test)]
mod tests;

pub use abort::Abort;
pub use device::{Drive, DriveSnapshot};
pub use device_file::{DeviceFile, DeviceFileError};
pub use family::{Family, Mode};
pub use fault::{Fault, Reaction};
pub use motor::{DriveConfig, Limits, Motor, MotorConfig};
pub use profile::{Demand, ProfileLimits};
pub use service::{Gateway, Reply};
pub use state::State;
