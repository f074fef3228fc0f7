//! Setpoint generation: motion of all axes in a tick, according to the state.

use crate::core::command::deadline::FollowedCommand;
use crate::core::motion::GoalStep;
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::conditioning::ConditioningCycle;
use crate::core::motion::gate::Motion;
use crate::core::motion::inverse_setpoint::{InverseSetpoint, MotionTick};
use crate::core::motion::joint_model::NotFinite;
use crate::core::motion::joint_trajectory::JointTrajectory;
use crate::core::states::control_state::{ControlState, EnabledActivity};
use crate::robot::Clip;
use crate::units::{Nanos, OutputVec};

/// The goal that the setpoints of a tick move to.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct GeneratedSetpoint {
    /// rad (m); `None` where no goal in joint space is known.
    pub goal: Option<OutputVec>,
    pub clip: Option<Clip>,
    /// Stamp of the followed command; zero: none.
    pub command_stamp: Nanos,
    /// Sequence of the followed command; zero: none.
    pub command_sequence: u64,
    /// The activity after this tick, if it changes.
    pub next: Option<EnabledActivity>,
    /// Motion of the setpoints; `None`: stop.
    pub motion: Option<Motion>,
}

impl From<&InverseSetpoint> for GeneratedSetpoint {
    fn from(inverse: &InverseSetpoint) -> Self {
        Self { goal: inverse.goal, motion: Some(inverse.motion), ..Self::default() }
    }
}

impl MotionTick<'_> {
    /// The motion of this tick, for the gate.
    pub(super) fn generate(
        &mut self,
        state: &ControlState,
    ) -> Result<GeneratedSetpoint, NotFinite> {
        if !state.is_following_joints() {
            self.fixtures.release_goal();
            if let Some(joints) = &mut self.joints {
                joints.release_goal();
            }
        }
        match state {
            ControlState::Enabled(EnabledActivity::Following(command)) => {
                self.follow_command(command)
            }
            ControlState::Enabled(EnabledActivity::Conditioning(cycle)) => {
                self.run_conditioning(cycle)
            }
            ControlState::Enabled(EnabledActivity::Moving(trajectory)) => {
                self.follow_trajectory(trajectory)
            }
            ControlState::Enabled(EnabledActivity::Holding)
            | ControlState::Disabled(_)
            | ControlState::Paused
            | ControlState::Fault(_) => Ok(GeneratedSetpoint::default()),
        }
    }

    fn follow_command(
        &mut self,
        command: &FollowedCommand,
    ) -> Result<GeneratedSetpoint, NotFinite> {
        let inverse = self.follow_goal(&command.goal)?;
        Ok(GeneratedSetpoint {
            clip: command.clip(),
            command_stamp: command.stamp,
            command_sequence: command.sequence,
            ..GeneratedSetpoint::from(&inverse)
        })
    }

    fn run_conditioning(
        &mut self,
        cycle: &ConditioningCycle,
    ) -> Result<GeneratedSetpoint, NotFinite> {
        let next = cycle.after_tick();
        let cycle = next.as_ref().unwrap_or(cycle);
        let motion = Some(Motion::Track { targets: cycle.targets(), in_hull: false });
        let joints = self.joints.as_deref();
        let goal = joints.map(|joints| joints.pose(&cycle.position)).transpose()?;
        let next = next.map_or(EnabledActivity::Holding, EnabledActivity::Conditioning);
        Ok(GeneratedSetpoint { goal, next: Some(next), motion, ..GeneratedSetpoint::default() })
    }

    fn follow_trajectory(
        &mut self,
        trajectory: &JointTrajectory,
    ) -> Result<GeneratedSetpoint, NotFinite> {
        let before = trajectory.position_at(self.now - self.period);
        let goal = GoalStep { now: trajectory.position_at(self.now), before };
        let inverse = self.invert_goal(goal, trajectory.end())?;
        let is_finished =
            trajectory.is_finished(self.now) && self.axes.all(AxisControl::is_settled);
        Ok(GeneratedSetpoint {
            clip: inverse.is_beyond.then_some(Clip::Reach),
            next: is_finished.then_some(EnabledActivity::Holding),
            ..GeneratedSetpoint::from(&inverse)
        })
    }
}
