//! For the tests of the command-line programs.
//!
//! | file | holds |
//! |---|---|
//! | [`controller`] | a controller without drives that misbehaves on request |
//! | `enabling` | homes and enables the robot of a real controller |
//! | [`program`] | the programs of this build |
//! | [`mod@python`] | a Python with the modules of a test |
//! | `shared_machine` | the configuration of a controller on a machine that tests share |
//! | [`terminal`] | a program on a terminal of any size |
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::missing_panics_doc,
    clippy::print_stderr,
    reason = "code of tests"
)]

pub mod controller;
mod enabling;
pub mod program;
pub mod python;
mod shared_machine;
pub mod terminal;

pub use controller::{Controller, Robot};
pub use enabling::home_and_enable;
pub use program::Program;
pub use python::{python, run_python};
pub use shared_machine::run_on_shared_machine;
pub use terminal::Terminal;
