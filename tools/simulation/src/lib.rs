//! A simulated robot: snakes, motors, drives, camera; the real control cycle in simulated time.
//!
//! Physics and drives are a strict test bench for the controller. They share no model code and no
//! frame codec with it: both sides are written from the references independently, which a test
//! checks. Where a reference leaves something open, the emulator chooses the worst case for a
//! careless host.
//!
//! ```text
//! host == pseudo-terminal == port (line timing) == drive --wire--+
//!                                                                +-- snake -- camera
//! host == pseudo-terminal == port (line timing) == drive --wire--+
//!
//! ControlCycle == setpoints, encoders (closed_loop) == motors ------ snake -- camera
//! ControlCycle == port threads == line timing (lines) == drives ---- snake -- camera
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`physics`] | motor positions to angles, with the hysteresis of eight theories; pure |
//! | [`ageing`] | parameters of a snake as functions of time; pure |
//! | [`camera`] | measured angles of the snake; pure |
//! | [`drive`] | an EPOS4 or EPOS2: frames, objects, states, modes, motor; pure |
//! | [`robot`] | motors and snake in simulated time, without lines and threads; pure |
//! | [`closed_loop`] | the control cycle with simulated motors; pure |
//! | [`lines`] | port threads, lines and drives in simulated time, for use with `closed_loop` |
//! | [`motion`] | motions for calibration, and motions that are in no calibration; pure |
//! | [`emulator`] | the drives on pseudo-terminals, with threads; scenarios and injected faults |
//!
//! Pure modules take time as an argument. The threads read [`i2ris::clock`].
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod ageing;
pub mod camera;
pub mod closed_loop;
pub mod drive;
pub mod emulator;
pub mod lines;
pub mod motion;
pub mod physics;
pub mod robot;

pub use drive::frame;
pub use emulator::config::{DEFAULT_FOLDER, EmulatorConfig, Line, SnakeSource, SnakeSourceError};
pub use emulator::injection::Injection;
pub use emulator::log;
pub use emulator::port::{FolderError, LineConfig};
pub use emulator::scenario::{Scenario, ScenarioError};
pub use emulator::{AxisSnapshot, Emulator, EmulatorError, Snapshot};
