//! The drive layer: the link, bring-up, the port thread and its axes on a simulated line; the
//! conformance suite on emulated and real drives; the watchdog process.
//!
//! Matrix of the conformance suite: `cargo test --test drive -- --ignored --nocapture matrix`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may")]

mod bring_up;
mod conformance;
#[path = "../rig/mod.rs"]
mod controller_rig;
mod every_frame;
mod fixture;
mod link;
mod runner;
mod watchdog;
