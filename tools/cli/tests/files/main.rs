//! `i2ris` on files alone. These tests compute without pause, so they are kept apart from emulated
//! drives, whose pseudo-terminals would starve.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

#[path = "../cli/bench.rs"]
mod bench;
mod cases;
mod drift;
mod fit;
mod model;
