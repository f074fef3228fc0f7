//! Calibration.
pub mod em;
pub mod progress;
pub mod table;
