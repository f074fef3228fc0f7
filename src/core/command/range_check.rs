//! Range check: the goals that a servo command may request. Checks 10 to 13 of `admission`.

use crate::config::CommandConfig;
use crate::core::command::followed_command::FollowedCommand;
use crate::core::inputs::{ServoCommand, ServoGoal};
use crate::core::joint_space::joint_model::JointModel;
use crate::core::joint_space::reach::reach;
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::goal_extrapolation::{ExtrapolatedGoal, GoalExtrapolation};
use crate::core::vector::{distance, first_entries, largest_difference};
use crate::model::file::OutputUnit;
use crate::robot::{Measurement, Quantity, Refusal};
use crate::units::{Counts, MAX_MOTORS, MAX_OUTPUTS, OutputVec};

/// Rounding of degrees to radians must not refuse a step of exactly the limit.
const STEP_MARGIN: f64 = 1.0 + 1e-9;

/// The largest steps from one command to the next.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RangeCheck {
    followed: LargestStep,
    /// From the present setpoint to the first command of a stream: also after a pause, a stop and
    /// a fault.
    first: LargestStep,
}

#[derive(Debug, Clone, Copy)]
struct LargestStep {
    /// Length, rad.
    joint: f64,
    /// Of every motor, counts.
    actuator: f64,
}

impl RangeCheck {
    pub fn new(config: &CommandConfig) -> Self {
        Self {
            followed: LargestStep {
                joint: config.max_step_deg.to_radians(),
                actuator: f64::from(config.max_step_counts),
            },
            first: LargestStep {
                joint: config.first_step_deg.min(config.max_step_deg).to_radians(),
                actuator: f64::from(config.first_step_counts.min(config.max_step_counts)),
            },
        }
    }

    fn largest(&self, is_first: bool) -> &LargestStep {
        if is_first { &self.first } else { &self.followed }
    }

    /// Checks the goal of a command. Returns the goal to follow: the continuation of the followed
    /// goal if it is of the same kind, or a new one, which must begin near the present setpoints.
    /// Angles out of reach are clipped on the line from the last goal that was in reach.
    pub fn check(
        &self,
        command: &ServoCommand,
        followed: Option<&FollowedCommand>,
        axes: &AxisGroup,
        joints: Option<&JointModel>,
    ) -> Result<ExtrapolatedGoal, Refusal> {
        match command.goal {
            ServoGoal::Joint(angles, entries) => {
                let before = followed.and_then(FollowedCommand::joint);
                let joints = joints.ok_or(Refusal::NoModel)?;
                require(entries as usize == joints.outputs(), Refusal::Malformed)?;
                let angles = first_entries::<MAX_OUTPUTS>(angles, entries);
                let last = before.map(|(_, requested)| requested);
                let is_near = self.is_joint_step_allowed(&angles, last, axes, joints)?;
                require(is_near, Refusal::Step)?;
                let from = before.map(|(goal, _)| *goal.goal()).or(joints.setpoint());
                // What is not finite here becomes a fault where it is followed.
                let reached = from.and_then(|from| reach(joints, axes, &from, &angles).ok());
                Ok(match reached.filter(|reached| *reached != angles) {
                    // A goal at the border does not run ahead across it.
                    Some(clipped) => {
                        ExtrapolatedGoal::Joint(GoalExtrapolation::first(clipped, command.stamp))
                    }
                    None => ExtrapolatedGoal::Joint(extend(before.map(|it| it.0), angles, command)),
                })
            }
            ServoGoal::Actuator(counts, entries) => {
                let before = match followed.map(|followed| &followed.goal) {
                    Some(ExtrapolatedGoal::Actuator(before)) => Some(before),
                    Some(ExtrapolatedGoal::Joint(_)) | None => None,
                };
                require(entries as usize == axes.count(), Refusal::Malformed)?;
                require(axes.allow(&counts), Refusal::Range)?;
                let counts = first_entries::<MAX_MOTORS>(counts.map(Counts::as_f64), entries);
                let from = before.map_or_else(|| axes.setpoints(), |before| *before.goal());
                let largest = self.largest(before.is_none());
                require(largest_difference(&counts, &from) <= largest.actuator, Refusal::Step)?;
                Ok(ExtrapolatedGoal::Actuator(extend(before, counts, command)))
            }
        }
    }

    /// The step of a command that is refused for it, and the limit. Only in angles or counts: the
    /// motors of a tip position are not what the client commands.
    pub fn step_measurement(
        &self,
        command: &ServoCommand,
        followed: Option<&FollowedCommand>,
        axes: &AxisGroup,
        joints: Option<&JointModel>,
    ) -> Option<Measurement> {
        match command.goal {
            ServoGoal::Joint(angles, entries) => {
                let joints = joints.filter(|joints| joints.unit() == OutputUnit::Deg)?;
                let (from, is_first) = match followed.and_then(FollowedCommand::joint) {
                    Some((_, requested)) => (*requested, false),
                    None => (joints.setpoint()?, true),
                };
                let angles = first_entries::<MAX_OUTPUTS>(angles, entries);
                let step = distance(&angles, &from).to_degrees();
                let limit = Some(self.largest(is_first).joint.to_degrees());
                Some(Measurement::new(Quantity::Degrees, step, limit))
            }
            ServoGoal::Actuator(counts, entries) => {
                let (from, is_first) = match followed.map(|followed| &followed.goal) {
                    Some(ExtrapolatedGoal::Actuator(before)) => (*before.goal(), false),
                    Some(ExtrapolatedGoal::Joint(_)) | None => (axes.setpoints(), true),
                };
                let counts = first_entries::<MAX_MOTORS>(counts.map(Counts::as_f64), entries);
                let step = largest_difference(&counts, &from);
                let limit = Some(self.largest(is_first).actuator);
                Some(Measurement::new(Quantity::Counts, step, limit))
            }
        }
    }

    /// Angles are compared as angles. The position of a tip has no degrees, so the motor positions
    /// of its inverse are compared.
    fn is_joint_step_allowed(
        &self,
        goal: &OutputVec,
        before: Option<&OutputVec>,
        axes: &AxisGroup,
        joints: &JointModel,
    ) -> Result<bool, Refusal> {
        let largest = self.largest(before.is_none());
        match joints.unit() {
            OutputUnit::Deg => {
                let setpoint = || joints.setpoint().ok_or(Refusal::DrivesNotReady);
                let from = before.copied().map_or_else(setpoint, Ok)?;
                // A distance that is not a number is not allowed.
                Ok(distance(goal, &from) <= largest.joint * STEP_MARGIN)
            }
            OutputUnit::Mm => {
                let solve = |goal| joints.solve(goal).map(|inverse| inverse.counts);
                let from = before.map_or_else(|| Ok(axes.setpoints()), solve);
                let (Ok(from), Ok(to)) = (from, solve(goal)) else {
                    return Ok(false);
                };
                Ok(largest_difference(&to, &from) <= largest.actuator)
            }
        }
    }
}

pub(crate) fn require(is_met: bool, refusal: Refusal) -> Result<(), Refusal> {
    if is_met { Ok(()) } else { Err(refusal) }
}

fn extend<const N: usize>(
    before: Option<&GoalExtrapolation<N>>,
    goal: [f64; N],
    command: &ServoCommand,
) -> GoalExtrapolation<N> {
    match before {
        Some(before) => before.next(goal, command.stamp),
        None => GoalExtrapolation::first(goal, command.stamp),
    }
}
