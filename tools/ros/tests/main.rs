//! The robot in ROS 2: a client with the topics of CRTK, clients that misbehave, and a foreign
//! implementation.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "tests, which report when they skip"
)]

mod common;
mod crtk;
mod cyclone;
mod master;
mod misuse;
mod peer;
mod session;
