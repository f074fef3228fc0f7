//! What runs in simulated time, or in none: the cycle, the lines of drives, the models, the
//! adaptation. What computes without a pause is here: beside it the pseudo-terminals
//! of emulated drives starve.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a test may")]

mod adaptation;
mod cycle;
mod drive;
mod model;
