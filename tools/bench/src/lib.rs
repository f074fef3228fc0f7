//! Tracking accuracy of models on emulated snakes, in simulated time: the kernel of the Python
//! package's hysteresis benchmark, and `i2ris bench models`, `lines` and `limits`.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "commands print")]
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod limits;
pub mod lines;
pub mod models;
