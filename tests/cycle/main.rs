//! The control cycle against simulated drives, on simulated time.
//!
//! `bench` builds a cycle in a given state and ticks it; `invariants` checks every tick of every
//! test.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod bench;
mod command_admission;
mod command_flags;
mod command_table;
mod conditioning;
mod enabling;
mod endurance;
mod faults;
mod following;
mod invariants;
mod model_swap;
mod move_and_clutch;
mod random_inputs;
mod reasons;
mod rehearsal;
mod replay;
mod report;
mod shutdown;
mod simulated_drive;
mod stopping;
mod virtual_fixtures;
