//! Two emulated maxon drives on pseudo-terminals with a hysteretic snake behind them.
//!
//! The emulator is a strict test bench for the controller. It shares no model code and no frame
//! codec with it: both sides are written from the reference independently. Where the reference
//! leaves something open, the emulator does what a careless host handles worst.
//!
//! ```text
//! host == pseudo-terminal == port (line timing) == drive --wire--+
//!                                                                +-- snake -- camera
//! host == pseudo-terminal == port (line timing) == drive --wire--+
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`snake`] | motor positions to angles, with hysteresis; pure |
//! | [`ageing`] | parameters of a snake as functions of time; pure |
//! | [`zoo`] | snakes of other physics, drawn by a seed; pure |
//! | [`frame`] | V2 frames of the serial line; pure |
//! | [`drive`] | an EPOS4 or EPOS2: objects, states, modes, motor; pure |
//! | `snake_source` | snakes by name, by physics and seed, or from a file |
//! | [`camera`] | measured angles of the snake; pure |
//! | `wire`, `plant` | the wires; drives, wires and snake in time steps; pure |
//! | [`injection`], [`scenario`] | fault injection, and files with injection times |
//! | [`log`] | events in memory and in a file |
//! | `port` | pseudo-terminals, line timing, V1 handshake, damaged bytes |
//! | `shared`, `scenario_player`, `control_socket` | state and work of the threads |
//! | [`simulated_robot`] | motors and snake in simulated time, without lines and threads |
//! | [`config`], [`emulator`] | configuration; the threads and the public handle |
//!
//! Pure modules take time as an argument. The threads read [`i2ris::clock`].
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod ageing;
pub mod camera;
pub mod config;
mod control_socket;
pub mod drive;
pub mod emulator;
pub mod frame;
pub mod injection;
pub mod log;
mod plant;
mod port;
pub mod scenario;
mod scenario_player;
mod shared;
pub mod simulated_robot;
pub mod snake;
mod snake_source;
mod wire;
pub mod zoo;

pub use config::{DEFAULT_FOLDER, EmulatorConfig};
pub use emulator::{AxisSnapshot, Emulator, EmulatorError, Snapshot};
pub use injection::Injection;
pub use port::{FolderError, Framing, LineConfig};
pub use scenario::{Scenario, ScenarioError};
pub use snake_source::{SnakeSource, SnakeSourceError};
