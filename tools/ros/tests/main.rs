//! The robot in ROS 2: a client with the topics of CRTK, clients that do what they should not, and
//! an end that is not ours.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "tests, and those that skip say so"
)]

mod common;
mod crtk;
mod cyclone;
mod master;
mod misuse;
mod peer;
mod session;
