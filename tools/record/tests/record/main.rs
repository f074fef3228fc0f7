//! Recordings and their reports.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "tests, which report when they skip"
)]

mod crtk;
mod export;
mod files;
mod interfaces;
mod pictures;
mod programs;
mod reasons;
mod trial;
mod trial_faults;
