//! Motions: those for calibration, those that are in no calibration, and the time along them. Pure.

pub mod paced_motion;
pub mod protocol;
pub mod trajectory_time;
pub mod unseen_motion;
