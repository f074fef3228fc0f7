//! Motion: from a goal to the setpoint of every motor, within the limits.
//!
//! A command is followed until it is older than its deadline. Then the setpoints slow down with the
//! stop deceleration and hold. At the default limits and 1 kHz, the last setpoint that moves is in
//! the tick that detects the stale command, and the first at rest is one tick later. The next valid
//! command moves on from there.
//!
//! Angles are inverted in every tick, clamped to the position limits of the axes, limited per motor
//! and rounded. `goal_extrapolation` defines what happens between commands, `velocity_limit` what
//! the limits guarantee. Together: motion within the limits is followed without lag, at every
//! command rate above 50 Hz; `joint_filter` compensates the delay of lines and drives. The path of
//! the limiter towards a *step* is kept in the calibrated hull by the `gate`, where the whole order
//! of filters stands: motors with unequal distances do not move on a straight line.
//!
//! A drive that is off or not yet enabled has its own position as setpoint. When it reports to be
//! enabled, its setpoint starts where the drive holds, at the target that was preloaded, and at
//! rest.

pub(super) mod axis_control;
pub(super) mod axis_group;
pub(super) mod conditioning;
pub(super) mod gate;
pub(super) mod goal_extrapolation;
pub(super) mod joint_filter;
pub(super) mod joint_limits;
pub(super) mod joint_model;
pub(super) mod joint_trajectory;
pub(super) mod pipeline;
pub(super) mod reach;
mod setpoint_source;
pub mod velocity_limit;
pub(super) mod virtual_fixtures;

use crate::units::OutputVec;

/// A goal in this tick and one tick before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GoalStep {
    pub now: OutputVec,
    pub before: OutputVec,
}
