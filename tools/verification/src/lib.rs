//! A model of the whole system, checked in all interleavings: two commanders, one of them behind a
//! bridge, a network that delays and repeats, the controller, its serial line, the drive, and the
//! watchdog. Everything may fail at any time, and any number of times.
//!
//! # What is real and what is model
//!
//! Admission of commands, lease, deadline ([`i2ris::core`]), the shift between the clocks of two
//! computers ([`i2ris_network::offset`]) and the heartbeat monitor of the watchdog
//! ([`i2ris::watchdog`]) are the functions that the programs run. The states of robot and drive are
//! a model, small enough to be exhausted. The state machine itself is tested in every state with
//! every command by the tests of the cycle.
//!
//! # Time
//!
//! Time passes in steps of [`STEP`]. In one step the watchdog looks once and the loop runs once;
//! between two steps anything else may happen, in any order. All times are ages, and ages beyond
//! every limit are the same, so the states do not depend on how long the model has run.
//!
//! # Guards
//!
//! Each [`Guard`] can be taken out. Then the property that it guards must fail, which shows that
//! the property can fail at all, and that nothing else provides it.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

mod controller;
mod environment;
mod guard;
mod properties;
mod state;
mod system;

pub use guard::{Guard, Guards};
pub use state::{STEP, State};
pub use system::{Action, System};
