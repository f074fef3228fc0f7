//! The servo command that is being followed.

use serde::{Deserialize, Serialize};

use crate::core::command::deadline::stale_age;
use crate::core::command::tip_goal::ON_SURFACE_M;
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
    /// The angles as commanded, rad (m); of a rate, where it leads until its deadline if it is
    /// clipped on the way.
    pub requested: OutputVec,
    /// The goal is out of reach.
    pub is_clipped: bool,
    /// The place of the tip that was commanded, m, and how far the tip stays away from it.
    pub place: Option<(OutputVec, f64)>,
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
        self.is_clipped || self.place.is_some_and(|(_, away_m)| away_m > ON_SURFACE_M)
    }

    /// The age of the command, if it is stale.
    pub fn stale_age(&self, now: Nanos) -> Option<Nanos> {
        stale_age(self.stamp, self.deadline, now)
    }
}
