//! Calibration.
pub mod em;
pub mod progress;
pub mod recording;
pub mod table;
