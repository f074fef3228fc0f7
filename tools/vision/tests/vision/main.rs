//! Readings and refusals of the detector, and the program around it.
#![allow(clippy::unwrap_used)]

mod fibre;
mod program;
mod python;
mod session;
