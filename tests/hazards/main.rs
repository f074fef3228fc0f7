//! The hazards of the design, one module per id, at least one test in each: see the table in
//! `README.md` beside this file.
//!
//! Most tests run the controller as a process against emulated drives ([`rig`]); where the exact
//! tick matters, the cycle runs on counted time ([`bench`]).
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "tests, and campaigns that print numbers"
)]

#[allow(dead_code, reason = "shared with the tests of the cycle, which use all of it")]
#[path = "../cycle/bench.rs"]
mod bench;
#[path = "../cycle/invariants.rs"]
mod invariants;
mod noise;
#[path = "../rig/mod.rs"]
mod rig;
#[allow(dead_code, reason = "shared with the tests of the cycle, which use all of it")]
#[path = "../cycle/simulated_drive.rs"]
mod simulated_drive;

mod campaign;
mod coverage;
mod documents;
mod drifting;
mod h01;
mod h02;
mod h03;
mod h04;
mod h05;
mod h06;
mod h07;
mod h08;
mod h09;
mod h10;
mod h11;
mod h12;
mod h13;
mod h14;
mod h15;
mod h16;
mod h17;
mod h18;
mod h20;
mod h21;
mod h22;
mod h23;
