//! What the command-line programs of i2ris share.
//!
//! | file | holds |
//! |---|---|
//! | [`programs`] | the programs that `i2ris NAME` starts, and where they are found |
//! | [`program`] | the main function of a program: command line, exit code |
//! | [`description`] | a command line as JSON, for the shell completions of `i2ris` |
//! | [`exit`] | exit codes |
//! | [`domain_option`] | the option `--domain` |
//! | [`interrupt`] | SIGINT, SIGTERM and SIGHUP |
//! | [`screen`] | standard output, redrawn on a terminal |
//! | [`spinner`] | a sign of life during long work |
//! | [`files`] | atomic replacement of files |
//! | [`pose_table`] | pitch and yaw over time from a CSV file |
//! | [`view`] | the robot as people see it: one value for every surface |
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod description;
pub mod domain_option;
pub mod exit;
pub mod files;
pub mod interrupt;
pub mod pose_table;
pub mod program;
pub mod programs;
pub mod screen;
pub mod spinner;
pub mod view;

pub use domain_option::DomainOption;
pub use interrupt::Interrupt;
pub use screen::{Screen, until_closed};
pub use spinner::while_working;

/// Why a program ends without success: one sentence for the user.
pub type Failure = Box<dyn std::error::Error>;
