//! From the goal to the set-points of the motors.

pub(crate) mod axis;
pub(crate) mod backlash_dead_band;
pub(crate) mod conditioning;
pub(crate) mod inverse_setpoint;
pub(crate) mod jerk_limit;
pub(crate) mod joint_filter;
pub(crate) mod joint_space;
pub(crate) mod joint_trajectory;
pub mod velocity_limit;
