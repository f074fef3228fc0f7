//! The robot in ROS 2: a client of CRTK, clients that misbehave, a foreign implementation.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(clippy::print_stderr, clippy::print_stdout, reason = "tests report when they skip")]

mod common;
mod crtk;
mod cyclone;
mod master;
mod misuse;
mod session;
