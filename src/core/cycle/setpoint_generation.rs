//! Setpoint generation: motion of all axes in a tick, according to the state, by the inverse of the
//! model.

use crate::core::command::client_stream::FollowedCommand;
use crate::core::motion::GoalStep;
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::conditioning::ConditioningCycle;
use crate::core::motion::gate::Motion;
use crate::core::motion::goal_extrapolation::ExtrapolatedGoal;
use crate::core::motion::joint_model::{JointModel, NotFinite};
use crate::core::motion::joint_trajectory::JointTrajectory;
use crate::core::motion::pipeline::PassedGoal;
use crate::core::motion::velocity_limit::MotorTarget;
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::states::control_state::{ControlState, EnabledActivity};
use crate::core::vector::difference;
use crate::robot::Clip;
use crate::units::{MotorVec, Nanos, OutputVec};

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

/// State that moves in a tick.
pub(super) struct MotionTick<'a> {
    pub axes: &'a AxisGroup,
    pub joints: Option<&'a mut JointModel>,
    pub fixtures: &'a mut VirtualFixtures,
    /// Start of the tick.
    pub now: Nanos,
    /// Length of a tick.
    pub period: Nanos,
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

    /// The inverse is computed every tick, because a model with memory gives another solution after
    /// every motion. The goal of one tick before is inverted with the same memory: the target's
    /// increment is the motion of the goal, not what the model has learned in between.
    fn follow_command(
        &mut self,
        command: &FollowedCommand,
    ) -> Result<GeneratedSetpoint, NotFinite> {
        let setpoint = match &command.goal {
            ExtrapolatedGoal::Joint(goal) => {
                let (here, before) = goal.evaluate(self.now, self.period);
                self.invert_goal(GoalStep { now: here, before }, &goal.goal)?
            }
            ExtrapolatedGoal::Actuator(goal) => {
                let (here, before) = goal.evaluate(self.now, self.period);
                let joints = self.joints.as_deref();
                let goal = joints.map(|joints| joints.pose(&goal.goal)).transpose()?;
                let motion = motion(&self.axes.clamp(here), &self.axes.clamp(before), false);
                GeneratedSetpoint { goal, motion: Some(motion), ..GeneratedSetpoint::default() }
            }
        };
        Ok(GeneratedSetpoint {
            clip: command.clip(),
            command_stamp: command.stamp,
            command_sequence: command.sequence,
            ..setpoint
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
        let setpoint = self.invert_goal(goal, trajectory.end())?;
        let is_finished =
            trajectory.is_finished(self.now) && self.axes.all(AxisControl::is_settled);
        let next = is_finished.then_some(EnabledActivity::Holding);
        Ok(GeneratedSetpoint { next, ..setpoint })
    }

    /// Targets for a goal in joint space. `requested`: the goal that is reported, before
    /// extrapolation or at the end of the trajectory. A goal out of reach is clipped: the motors go
    /// to what is nearest.
    fn invert_goal(
        &mut self,
        goal: GoalStep,
        requested: &OutputVec,
    ) -> Result<GeneratedSetpoint, NotFinite> {
        // Angles are only accepted, and trajectories only planned, with a model.
        let joints = self.joints.as_deref_mut().ok_or(NotFinite)?;
        let times = [self.now, self.now - self.period];
        let PassedGoal { limited, goal } = joints.pass_goal(goal, self.fixtures, times)?;
        let [inverse, inverse_before] = if goal.before == goal.now {
            [joints.solve(&goal.now)?; 2]
        } else {
            joints.solve_each(&[goal.now, goal.before])?
        };
        let counts = self.axes.clamp(inverse.counts);
        joints.set_search_start(counts);
        let is_limited = self.fixtures.limited_by.is_some();
        let is_beyond = inverse.clipped || counts != inverse.counts;
        Ok(GeneratedSetpoint {
            goal: Some(if is_limited { limited } else { *requested }),
            clip: is_beyond.then_some(Clip::Reach),
            motion: Some(motion(&counts, &self.axes.clamp(inverse_before.counts), true)),
            ..GeneratedSetpoint::default()
        })
    }
}

fn motion(now: &MotorVec, before: &MotorVec, in_hull: bool) -> Motion {
    Motion::Track { targets: MotorTarget::from_vectors(now, &difference(now, before)), in_hull }
}
