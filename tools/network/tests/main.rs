//! The bridge: who may watch and command, both ends with the programs of a client, a client in
//! Python, and what the snake does when the network is cut.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "tests, and those that skip say so"
)]

mod access;
mod bridge;
mod cable;
mod common;
mod python;
mod relay;
mod sentences;
mod two_computers;
