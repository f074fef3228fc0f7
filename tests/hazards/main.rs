//! The hazards of the design, one module per id, at least one test in each: see the table in the README.
//!
//! Where real processes prove more, the controller runs as a process against emulated drives ([`rig`]); where the exact tick
//! matters, the cycle runs on counted time ([`bench`]).
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[allow(dead_code, reason = "shared with the tests of the cycle, which use all of it")]
#[path = "../cycle/bench.rs"]
mod bench;
#[allow(dead_code, reason = "shared with the tests of the cycle, which use all of it")]
#[path = "../cycle/drive.rs"]
mod drive;
#[path = "../cycle/invariant.rs"]
mod invariant;
mod live;
#[path = "../rig/mod.rs"]
mod rig;

mod h08;
