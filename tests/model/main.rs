//! The model runtime through its public interface.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod file;
mod gmr;
mod hull;
mod inverse;
mod linear;
mod refusals;
mod samples;
mod stop;
