//! Servo commands: admission, goal between commands, clutch.

pub(crate) mod admission;
pub(crate) mod clutch;
pub(crate) mod goal_extrapolation;
pub(crate) mod range_check;
