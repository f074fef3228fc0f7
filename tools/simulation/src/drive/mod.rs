//! An emulated EPOS4 or EPOS2: object dictionary, state machine, modes of operation, motor. It has
//! no clock and no line: requests and time steps in, replies and motor positions out.
//!
//! Sources: `epos4-serial.md`, sections 1 and 3, which names the clauses of maxon's documents.
//! Where the documents leave something open, the drive does what a careless host handles worst.
//!
//! | file | content |
//! |---|---|
//! | `device` | [`Drive`]: its state, start-up, encoder, snapshot |
//! | `config` | parameters of a drive |
//! | `family`, `object_map` | EPOS4 and EPOS2, and the objects that differ between them |
//! | `object`, `epos4_objects`, `epos2_objects` | object types and the two tables of objects |
//! | `dictionary` | values of the objects, and the checks on access |
//! | `state` | CiA 402 state machine |
//! | `controlword`, `statusword` | what a controlword starts; objects computed when they are read |
//! | `mode`, `task`, `motion` | modes of operation, and what they do in every time step |
//! | `profile`, `motor` | position demand, and the motor that follows it |
//! | `frame` | the V2 frame, as the drive sees it |
//! | `command_set` | opcodes and their parameters |
//! | `service`, `segmented_transfer` | requests to replies |
//! | `gateway` | requests for drives behind the one at the port |
//! | `abort`, `fault`, `event` | abort codes, fault codes, events for the log |

mod abort;
mod command_set;
mod config;
mod controlword;
mod device;
mod dictionary;
mod epos2_objects;
mod epos4_objects;
pub(crate) mod event;
mod family;
mod fault;
pub mod frame;
mod gateway;
mod mode;
mod motion;
mod motor;
mod object;
mod object_map;
mod profile;
mod segmented_transfer;
mod service;
mod state;
mod statusword;
mod task;
#[cfg(test)]
mod tests;

pub use abort::Abort;
pub use config::DriveConfig;
pub use device::{Drive, DriveSnapshot};
pub use family::Family;
pub use fault::{Fault, Reaction};
pub use gateway::Gateway;
pub use mode::Mode;
pub use motor::{Limits, Motor, MotorConfig};
pub use service::Reply;
pub use state::State;
