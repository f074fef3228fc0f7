//! Inverse setpoint: from a goal to targets of the motors, by the inverse of the model.

use crate::core::joint_space::gate::Motion;
use crate::core::joint_space::joint_model::{JointModel, NotFinite};
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::goal_extrapolation::ExtrapolatedGoal;
use crate::core::motion::joint_filter::GoalStep;
use crate::core::motion::velocity_limit::MotorTarget;
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::vector::difference;
use crate::model::Inverse;
use crate::units::{MotorVec, Nanos, OutputVec};

/// Targets of the motors in this tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InverseSetpoint {
    /// For the gate.
    pub motion: Motion,
    /// The requested goal, clipped to what can be reached, rad (m); `None` without a model.
    pub goal: Option<OutputVec>,
    pub is_clipped: bool,
}

/// The inverse of one goal.
#[derive(Debug, Clone, Copy)]
struct ClampedInverse {
    counts: MotorVec,
    /// The goal is outside of the hull or the position limits.
    is_clipped: bool,
}

/// What moves in a tick.
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
    /// Targets for the goal of a stream of commands.
    ///
    /// The inverse is computed every tick, because a model with memory gives another solution after
    /// every motion. The goal of one tick before is inverted with the same memory: the target's
    /// increment is the motion of the goal, not what the model has learned in between.
    pub fn follow_goal(&mut self, goal: &ExtrapolatedGoal) -> Result<InverseSetpoint, NotFinite> {
        match goal {
            ExtrapolatedGoal::Joint(goal) => {
                let (here, before) = goal.evaluate(self.now, self.period);
                self.invert_goal(GoalStep { now: here, before }, goal.goal())
            }
            ExtrapolatedGoal::Actuator(goal) => {
                let (here, before) = goal.evaluate(self.now, self.period);
                let joints = self.joints.as_deref();
                let pose = joints.map(|joints| joints.pose(goal.goal())).transpose()?;
                Ok(InverseSetpoint {
                    motion: motion(&self.axes.clamp(here), &self.axes.clamp(before), false),
                    goal: pose,
                    is_clipped: false,
                })
            }
        }
    }

    /// Targets for a goal in joint space. `requested`: the goal that is reported, before
    /// extrapolation or at the end of the trajectory.
    pub fn invert_goal(
        &mut self,
        goal: GoalStep,
        requested: &OutputVec,
    ) -> Result<InverseSetpoint, NotFinite> {
        // Angles are only accepted, and trajectories only planned, with a model.
        let joints = self.joints.as_deref_mut().ok_or(NotFinite)?;
        let start = joints.setpoint().ok_or(NotFinite)?;
        let wanted = joints.bounds().map_or(*requested, |bounds| bounds.clamp(requested));
        let filtered = joints.filter_goal(goal)?;
        let filtered = self.fixtures.limit(filtered, start, &joints.goal_space());
        let dead_banded = joints.dead_band_goal(&filtered.now);
        let before = if dead_banded.is_held { dead_banded.goal } else { filtered.before };
        let goal_now = joints.blend_goal(dead_banded.goal, self.now);
        let goal_before = joints.blend_goal(before, self.now - self.period);
        joints.set_goal_motion(difference(&goal_now, &goal_before));
        let goal_end = if goal_now == goal_before && filtered.now == wanted {
            goal_now
        } else {
            joints.blend_goal(wanted, self.now)
        };
        let [inverse_now, inverse_before, end] =
            clamped_inverses(&goal_now, &goal_before, &goal_end, self.axes, joints)?;
        joints.set_search_start(inverse_now.counts);
        let goal = if self.fixtures.limited_by().is_some() {
            filtered.now
        } else if end.is_clipped {
            joints.pose(&end.counts)?
        } else {
            wanted
        };
        Ok(InverseSetpoint {
            motion: motion(&inverse_now.counts, &inverse_before.counts, true),
            goal: Some(goal),
            is_clipped: end.is_clipped || wanted != *requested,
        })
    }
}

/// The inverses of the goal now, of the goal before, and of the end. Each is computed once.
fn clamped_inverses(
    now: &OutputVec,
    before: &OutputVec,
    end: &OutputVec,
    axes: &AxisGroup,
    joints: &JointModel,
) -> Result<[ClampedInverse; 3], NotFinite> {
    let clamped = |inverse: &Inverse| {
        let counts = axes.clamp(inverse.counts);
        ClampedInverse { counts, is_clipped: inverse.clipped || counts != inverse.counts }
    };
    Ok(match (before == now, end == now) {
        (true, true) => [clamped(&joints.solve(now)?); 3],
        (true, false) => {
            let [now, end] = joints.solve_each(&[*now, *end])?;
            [clamped(&now), clamped(&now), clamped(&end)]
        }
        (false, true) => {
            let [now, before] = joints.solve_each(&[*now, *before])?;
            [clamped(&now), clamped(&before), clamped(&now)]
        }
        (false, false) => joints.solve_each(&[*now, *before, *end])?.each_ref().map(clamped),
    })
}

fn motion(now: &MotorVec, before: &MotorVec, in_hull: bool) -> Motion {
    Motion::Track { targets: MotorTarget::from_vectors(now, &difference(now, before)), in_hull }
}
