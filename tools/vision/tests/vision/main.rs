//! Readings and refusals of the detector, and the program around it.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "tests, which report when they skip"
)]

mod fibre;
mod program;
mod python;
mod session;
