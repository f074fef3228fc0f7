//! The servo command that is being followed.

use serde::{Deserialize, Serialize};

use crate::core::command::deadline::stale_age;
use crate::core::motion::goal_extrapolation::{ExtrapolatedGoal, GoalExtrapolation};
use crate::units::{MAX_OUTPUTS, Nanos, OutputVec};

/// The last accepted command of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct FollowedCommand {
    pub client_id: u64,
    pub sequence: u64,
    /// Time of sending.
    pub stamp: Nanos,
    /// Age at which the command is stale.
    pub deadline: Nanos,
    /// The goal and its extrapolation. Angles are clipped to what can be reached.
    pub goal: ExtrapolatedGoal,
    /// The angles as commanded, rad (m).
    pub requested: OutputVec,
}

impl FollowedCommand {
    /// The goal in joint space, and the one that was requested.
    pub fn joint(&self) -> Option<(&GoalExtrapolation<MAX_OUTPUTS>, &OutputVec)> {
        match &self.goal {
            ExtrapolatedGoal::Joint(goal) => Some((goal, &self.requested)),
            ExtrapolatedGoal::Actuator(_) => None,
        }
    }

    pub fn is_clipped(&self) -> bool {
        self.joint().is_some_and(|(goal, requested)| goal.goal() != requested)
    }

    /// The age of the command, if it is stale.
    pub fn stale_age(&self, now: Nanos) -> Option<Nanos> {
        stale_age(self.stamp, self.deadline, now)
    }
}
