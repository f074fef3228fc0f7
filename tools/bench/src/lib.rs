//! How well models follow on emulated snakes, in simulated time: the kernel of the hysteresis
//! benchmark of the Python package, and `i2ris bench models`.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod models;
