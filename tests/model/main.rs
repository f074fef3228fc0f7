//! Tests of the model runtime through its public interface.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod direction;
mod drifted;
mod file;
mod gmr;
mod hull;
mod inverse;
mod kinematic;
mod linear;
mod plays;
mod prandtl_ishlinskii;
mod refusals;
mod samples;
mod stop;
