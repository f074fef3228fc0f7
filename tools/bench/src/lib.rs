//! Tracking accuracy of models on emulated snakes, in simulated time: the kernel of the Python
//! package's hysteresis benchmark, and `i2ris bench models`.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod models;
