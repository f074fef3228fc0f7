//! What runs in simulated time, or in none: the cycle, the models, the adaptation, all interleavings.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a test may")]

mod adaptation;
mod cycle;
mod model;
mod verification;
