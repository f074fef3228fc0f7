//! Tests in real time: drives on pseudo-terminals, shared memory, processes and signals.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a test may")]

mod hazards;
mod process;
mod serial;
