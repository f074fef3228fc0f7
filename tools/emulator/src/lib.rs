//! Two emulated maxon drives on pseudo-terminals with a hysteretic snake behind them.
//!
//! It exists to be a strict examiner of the controller, so it shares no model code and no frame
//! codec with it: both sides are written from the reference on their own. Where the reference
//! leaves something open, the emulator does what hurts a careless host most.
//!
//! ```text
//! host == pseudo-terminal == port (baud pacing) == drive --motor--+
//!                                                                 +-- snake -- camera
//! host == pseudo-terminal == port (baud pacing) == drive --motor--+
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`snake`] | the snake: motor positions to angles; pure |
//! | [`frame`] | frames of the serial line; pure |
//! | [`drive`] | an EPOS4 or EPOS2: objects, states, modes, motor; pure |
//! | [`camera`] | pictures of the snake; pure |
//! | [`log`] | what happened, in memory and in a file |
//! | [`scenario`] | what can be done to drives, lines and wires, and files that say when |
//! | [`emulator`] | the threads, and the handle that tests and the command line hold |
//!
//! Everything pure takes time as an argument; the threads read the clock of [`i2ris::clock`].
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod camera;
mod control;
pub mod drive;
pub mod emulator;
pub mod frame;
pub mod log;
mod port;
pub mod scenario;
pub mod snake;
mod wire;
mod world;

pub use emulator::{
    AxisSnapshot, DEFAULT_FOLDER, Emulator, EmulatorConfig, EmulatorError, Snapshot,
};
pub use port::{FolderError, Framing, LineConfig};
pub use scenario::{Injection, Scenario, ScenarioError};
