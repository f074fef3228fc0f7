//! `i2ris` on files alone. What computes without a pause is here: beside it the pseudo-terminals of
//! emulated drives starve.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

#[path = "../cli/bench.rs"]
mod bench;
mod cases;
mod drift;
mod fit;
mod model;
