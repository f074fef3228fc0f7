//! The emulator from outside: lines, camera, configuration files.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "tests, which report when they skip"
)]

mod camera;
mod config_files;
mod line;
