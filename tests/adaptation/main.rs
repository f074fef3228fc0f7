//! Adaptation in simulated time, on snakes whose physics share no code with the models.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "tests, and campaigns that print numbers"
)]

mod camera;
mod fitted;
mod random;
mod trial;

mod accuracy;
mod campaign;
mod fences;
