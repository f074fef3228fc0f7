//! Motions: those that calibrate, those that no calibration has seen, and the time along them.
//! Pure.

pub mod paced_motion;
pub mod protocol;
mod reversals;
pub mod trajectory_time;
pub mod unseen_motion;
