//! Inverse setpoint: from a goal to targets of the motors, by the inverse of the model.

use crate::core::motion::GoalStep;
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::gate::Motion;
use crate::core::motion::goal_extrapolation::ExtrapolatedGoal;
use crate::core::motion::joint_model::{JointModel, NotFinite};
use crate::core::motion::pipeline::PassedGoal;
use crate::core::motion::velocity_limit::MotorTarget;
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::vector::difference;
use crate::units::{MotorVec, Nanos, OutputVec};

/// Targets of the motors in this tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InverseSetpoint {
    /// For the gate.
    pub motion: Motion,
    /// The goal to report, rad (m); `None` without a model.
    pub goal: Option<OutputVec>,
    /// The goal of this tick is out of reach: the motors go to what is nearest.
    pub is_beyond: bool,
}

/// State that moves in a tick.
pub(crate) struct MotionTick<'a> {
    pub axes: &'a AxisGroup,
    /// The active model; `None` without one.
    pub joints: Option<&'a mut JointModel>,
    pub fixtures: &'a mut VirtualFixtures,
    /// Start of the tick.
    pub now: Nanos,
    /// Length of a tick.
    pub period: Nanos,
}

impl MotionTick<'_> {
    /// Targets for the goal of a command stream.
    ///
    /// The inverse is computed every tick, because a model with memory gives another solution after
    /// every motion. The goal of one tick before is inverted with the same memory: the target's
    /// increment is the motion of the goal, not what the model has learned in between.
    pub(crate) fn follow_goal(
        &mut self,
        goal: &ExtrapolatedGoal,
    ) -> Result<InverseSetpoint, NotFinite> {
        match goal {
            ExtrapolatedGoal::Joint(goal) => {
                let (here, before) = goal.evaluate(self.now, self.period);
                self.invert_goal(GoalStep { now: here, before }, &goal.goal)
            }
            ExtrapolatedGoal::Actuator(goal) => {
                let (here, before) = goal.evaluate(self.now, self.period);
                let joints = self.joints.as_deref();
                let pose = joints.map(|joints| joints.pose(&goal.goal)).transpose()?;
                Ok(InverseSetpoint {
                    motion: motion(&self.axes.clamp(here), &self.axes.clamp(before), false),
                    goal: pose,
                    is_beyond: false,
                })
            }
        }
    }

    /// Targets for a goal in joint space. `requested`: the goal that is reported, before
    /// extrapolation or at the end of the trajectory.
    pub(crate) fn invert_goal(
        &mut self,
        goal: GoalStep,
        requested: &OutputVec,
    ) -> Result<InverseSetpoint, NotFinite> {
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
        Ok(InverseSetpoint {
            motion: motion(&counts, &self.axes.clamp(inverse_before.counts), true),
            goal: Some(if is_limited { limited } else { *requested }),
            is_beyond: inverse.clipped || counts != inverse.counts,
        })
    }
}

fn motion(now: &MotorVec, before: &MotorVec, in_hull: bool) -> Motion {
    Motion::Track { targets: MotorTarget::from_vectors(now, &difference(now, before)), in_hull }
}
