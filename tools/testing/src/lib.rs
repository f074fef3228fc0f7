//! For the tests of the command-line programs.
//!
//! | file | holds |
//! |---|---|
//! | [`controller`] | a controller without drives that misbehaves on request |
//! | [`program`] | the programs of this build |
//! | [`terminal`] | a program on a terminal of any size |
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::missing_panics_doc,
    reason = "code of tests"
)]

pub mod controller;
pub mod program;
pub mod terminal;

pub use controller::{Controller, Robot};
pub use program::Program;
pub use terminal::Terminal;
