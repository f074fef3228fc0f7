//! Motion: from a goal to the setpoint of every motor, within the limits.

pub(super) mod axis_control;
pub(super) mod axis_group;
pub(super) mod backlash_dead_band;
pub(super) mod conditioning;
pub(super) mod conditioning_plan;
pub(super) mod goal_extrapolation;
mod jerk_limit;
pub(super) mod joint_filter;
mod joint_limits;
pub(super) mod joint_trajectory;
pub(super) mod s_curve;
mod setpoint_source;
mod tremor_filter;
pub mod velocity_limit;
pub mod virtual_fixtures;
