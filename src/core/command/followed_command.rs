//! The servo command that is being followed.

use serde::{Deserialize, Serialize};

use crate::core::command::deadline::stale_age;
use crate::core::motion::goal_extrapolation::ExtrapolatedGoal;
use crate::units::Nanos;

/// The last accepted command of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct FollowedCommand {
    pub client_id: u64,
    pub sequence: u64,
    /// Time of sending.
    pub stamp: Nanos,
    /// Age at which the command is stale.
    pub deadline: Nanos,
    /// The goal and its extrapolation.
    pub goal: ExtrapolatedGoal,
}

impl FollowedCommand {
    /// The age of the command, if it is stale.
    pub fn stale_age(&self, now: Nanos) -> Option<Nanos> {
        stale_age(self.stamp, self.deadline, now)
    }
}
