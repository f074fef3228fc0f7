//! Tests in simulated time or without time: the cycle, the lines of drives, the models, the
//! adaptation. They compute without a pause, which would starve the pseudo-terminals of emulated
//! drives in the same process.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a test may")]

mod adaptation;
mod cycle;
mod drive;
mod model;
