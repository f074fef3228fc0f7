//! The control cycle in simulated time, with two simulated drives. Every tick of every test is
//! checked against the invariants.

mod bench;
mod invariants;
mod recording;
mod sample_models;
mod simulated_drive;
mod states;

pub use bench::*;
pub use invariants::InvariantCheck;
pub use recording::Recording;
pub use sample_models::*;
pub use simulated_drive::{Quirk, SimulatedDrive};
