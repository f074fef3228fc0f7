//! Setpoint generation: moves the setpoints of all axes by one tick, as the state says.

use crate::core::command::followed_command::FollowedCommand;
use crate::core::joint_space::inverse_setpoint::{InverseSetpoint, MotionTick};
use crate::core::joint_space::joint_model::NotFinite;
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::conditioning::ConditioningCycle;
use crate::core::motion::joint_filter::GoalStep;
use crate::core::motion::joint_trajectory::JointTrajectory;
use crate::core::motion::velocity_limit::MotorTarget;
use crate::core::states::control_state::{ControlState, EnabledActivity};
use crate::units::{MAX_MOTORS, Nanos, OutputVec};

/// The goal that the setpoints of a tick move to.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct GeneratedSetpoint {
    /// rad (m); `None` where no goal in joint space is known.
    pub goal: Option<OutputVec>,
    pub is_clipped: bool,
    /// Stamp of the followed command; zero: none.
    pub command_stamp: Nanos,
    /// Sequence of the followed command; zero: none.
    pub command_sequence: u64,
    /// The activity after this tick, if it changes.
    pub next: Option<EnabledActivity>,
}

impl From<&InverseSetpoint> for GeneratedSetpoint {
    fn from(inverse: &InverseSetpoint) -> Self {
        Self { goal: inverse.goal, is_clipped: inverse.is_clipped, ..Self::default() }
    }
}

impl MotionTick<'_> {
    /// Moves the setpoints by one tick.
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
            | ControlState::Fault(_) => {
                self.axes.for_each(AxisControl::stop);
                Ok(GeneratedSetpoint::default())
            }
        }
    }

    fn follow_command(
        &mut self,
        command: &FollowedCommand,
    ) -> Result<GeneratedSetpoint, NotFinite> {
        let inverse = self.follow_goal(&command.goal)?;
        self.track_outside(&inverse.targets)?;
        Ok(GeneratedSetpoint {
            command_stamp: command.stamp,
            command_sequence: command.sequence,
            ..GeneratedSetpoint::from(&inverse)
        })
    }

    /// Moves the motors towards their targets, but no setpoint into a virtual fixture: the goal
    /// keeps out of it, but a motor that crosses its backlash lags, and then the path of the
    /// setpoints is another one. The motor that would cause it waits for the other one.
    fn track_outside(&mut self, targets: &[MotorTarget; MAX_MOTORS]) -> Result<(), NotFinite> {
        const NONE: u32 = 0;
        let joints = self.joints.as_deref().filter(|_| self.fixtures.is_on());
        let Some((joints, start)) = joints.and_then(|joints| Some((joints, joints.setpoint()?)))
        else {
            self.axes.track(targets);
            return Ok(());
        };
        let before = self.axes.to_snapshot();
        for moving in [0b11, 0b01, 0b10, NONE] {
            self.axes.track_some(targets, moving);
            let pose = joints.pose(&self.axes.setpoints())?;
            if moving == NONE || self.fixtures.allows_setpoint(&start, &pose, joints.unit()) {
                break;
            }
            self.axes.take_back(&before);
        }
        Ok(())
    }

    fn run_conditioning(
        &mut self,
        cycle: &ConditioningCycle,
    ) -> Result<GeneratedSetpoint, NotFinite> {
        let next = cycle.after_tick();
        let cycle = next.as_ref().unwrap_or(cycle);
        self.axes.track(&cycle.targets());
        let joints = self.joints.as_deref();
        let goal = joints.map(|joints| joints.pose(cycle.position())).transpose()?;
        let next = next.map_or(EnabledActivity::Holding, EnabledActivity::Conditioning);
        Ok(GeneratedSetpoint { goal, next: Some(next), ..GeneratedSetpoint::default() })
    }

    fn follow_trajectory(
        &mut self,
        trajectory: &JointTrajectory,
    ) -> Result<GeneratedSetpoint, NotFinite> {
        let before = trajectory.position_at(self.now - self.period);
        let goal = GoalStep { now: trajectory.position_at(self.now), before };
        let inverse = self.invert_goal(goal, trajectory.end())?;
        self.track_outside(&inverse.targets)?;
        let is_finished =
            trajectory.is_finished(self.now) && self.axes.all(AxisControl::is_settled);
        Ok(GeneratedSetpoint {
            is_clipped: inverse.is_clipped || trajectory.is_clipped(),
            next: is_finished.then_some(EnabledActivity::Holding),
            ..GeneratedSetpoint::from(&inverse)
        })
    }
}
