//! The drive layer: the link, bring-up, the port thread and its axes on a simulated line; the
//! conformance suite on emulated and real drives; the watchdog process.
//!
//! Matrix of the conformance suite: `cargo test --test real_time -- --ignored --nocapture matrix`.
//! Faults at random instants: the same with `faults_of_every`.

mod bring_up;
mod campaign;
mod capture;
mod conformance;
mod every_frame;
mod gateway_stop;
mod link;
mod runner;
mod watchdog;
