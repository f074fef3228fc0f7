//! An emulated EPOS4 or EPOS2: object dictionary, state machine, modes of operation, motor. It has
//! no clock and no line: requests and time steps in, replies and motor positions out.
//!
//! Sources: `epos4-serial.md`, sections 1 and 3, which names the clauses of maxon's documents.
//! Where the documents leave something open, the drive chooses the worst case for a careless host.
//!
//! | file | content |
//! |---|---|
//! | `device` | [`Drive`]: its state, start-up, encoder, snapshot |
//! | `family` | EPOS4 and EPOS2, modes of operation |
//! | `dictionary` | objects, their values, checks on access |
//! | `device_file` | objects of a real drive, as written by maxon's tool |
//! | `state` | CiA 402 state machine, and the motor task of the drive |
//! | `controlword` | effects of a controlword; objects computed when they are read |
//! | `motion` | the modes of operation in every time step |
//! | `motor` | position demand, the motor that follows it, parameters of a drive |
//! | `frame` | the V2 frame, from the drive's side |
//! | `command_set` | opcodes and their parameters, abort codes |
//! | `service` | requests to replies, also of other drives on the CAN bus |
//! | `event` | fault codes, events for the log |

mod command_set;
mod controlword;
mod device;
mod device_file;
mod dictionary;
pub(crate) mod event;
mod family;
pub mod frame;
mod motion;
mod motor;
mod service;
mod state;
#[cfg(test)]
mod tests;

pub use command_set::Abort;
pub use device::{Drive, DriveSnapshot};
pub use device_file::{DeviceFile, DeviceFileError};
pub use event::{Fault, Reaction};
pub use family::{Family, Mode};
pub use motor::{Demand, DriveConfig, Limits, Motor, MotorConfig, ProfileLimits};
pub use service::{Gateway, Reply};
pub use state::State;
