//! The drive layer on pseudo-terminals: the conformance suite on emulated and real drives, faults
//! at random instants, the watchdog process.
//!
//! Matrix of the conformance suite: `cargo test --test real_time -- --ignored --nocapture matrix`.
//! Faults at random instants: the same with `faults_of_every`.

mod campaign;
mod capture;
mod conformance;
mod opening;
mod watchdog;
