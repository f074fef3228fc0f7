//! The control cycle against simulated drives, on simulated time.
//!
//! `bench` builds a cycle in a wanted state and ticks it; `invariant` watches every tick of every
//! test.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod bench;
mod conditioning;
mod drive;
mod enabling;
mod faults;
mod following;
mod gate;
mod invariant;
mod leading;
mod random;
mod rehearsing;
mod replaying;
mod report;
mod shutdown;
mod stopping;
mod swapping;
mod table;
