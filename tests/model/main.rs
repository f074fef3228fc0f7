//! The model runtime through its public interface.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod linear;
mod samples;
