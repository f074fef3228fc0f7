//! What a servo command may ask: checks 10 to 13 of `gate`.

use crate::config::CommandConfig;
use crate::core::command::goal_extrapolation::Trend;
use crate::core::motion::axis::Axis;
use crate::core::motion::joint_space::Joints;
use crate::core::states::state::{Course, Follow};
use crate::core::{Goal, ServoCommand};
use crate::model::file::OutputUnit;
use crate::robot::Refusal;
use crate::units::{Counts, MAX_MOTORS, MotorVec, OutputVec};

/// Rounding of degrees to radians may not refuse a step of exactly the limit.
const STEP_MARGIN: f64 = 1.0 + 1e-9;

/// The largest differences between two commands in a row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Steps {
    /// Length of the difference, rad.
    joint: f64,
    /// Difference of every motor, counts.
    actuator: f64,
}

impl Steps {
    /// As configured.
    pub fn new(config: &CommandConfig) -> Self {
        Self {
            joint: config.max_step_deg.to_radians(),
            actuator: f64::from(config.max_step_counts),
        }
    }

    /// Checks what a command asks. The answer is the course to follow: the continuation of the
    /// present one if it is of the same kind, or a new one, which has to begin near the present
    /// set-points.
    pub fn course(
        &self,
        command: &ServoCommand,
        axes: &[Axis],
        joints: Option<&Joints>,
        following: Option<&Follow>,
    ) -> Result<Course, Refusal> {
        let course = following.map(|follow| &follow.course);
        match command.goal {
            Goal::Joint(angles, entries) => {
                let joints = joints.ok_or(Refusal::NoModel)?;
                require(entries as usize == joints.outputs(), Refusal::Malformed)?;
                let angles = first(angles, entries);
                let before = if let Some(Course::Joint(trend)) = course {
                    Some(trend)
                } else {
                    None
                };
                self.joint_step(&angles, before.map(|trend| *trend.goal()), axes, joints)?;
                Ok(Course::Joint(extend(before, angles, command)))
            }
            Goal::Actuator(counts, entries) => {
                require(entries as usize == axes.len(), Refusal::Malformed)?;
                require(
                    axes.iter()
                        .zip(counts)
                        .all(|(axis, counts)| axis.allows(counts)),
                    Refusal::Range,
                )?;
                let counts = first(counts.map(Counts::as_f64), entries);
                let before = if let Some(Course::Actuator(trend)) = course {
                    Some(trend)
                } else {
                    None
                };
                let from = before.map_or_else(|| setpoints(axes), |trend| *trend.goal());
                require(largest_step(&counts, &from) <= self.actuator, Refusal::Step)?;
                Ok(Course::Actuator(extend(before, counts, command)))
            }
        }
    }

    /// Angles are compared as angles. The position of a tip has no degrees, so there the motors are
    /// compared.
    fn joint_step(
        &self,
        goal: &OutputVec,
        before: Option<OutputVec>,
        axes: &[Axis],
        joints: &Joints,
    ) -> Result<(), Refusal> {
        match joints.unit() {
            OutputUnit::Deg => {
                let from = before
                    .or_else(|| joints.setpoint())
                    .ok_or(Refusal::DrivesNotReady)?;
                require(
                    distance(goal, &from) <= self.joint * STEP_MARGIN,
                    Refusal::Step,
                )
            }
            OutputUnit::Mm => {
                let solve = |goal: &OutputVec| joints.solve(goal).map(|answer| answer.counts);
                let from = before.map_or_else(|| Ok(setpoints(axes)), |before| solve(&before));
                let (Ok(from), Ok(to)) = (from, solve(goal)) else {
                    return Err(Refusal::Step);
                };
                require(largest_step(&to, &from) <= self.actuator, Refusal::Step)
            }
        }
    }
}

/// The set-points of all motors, before rounding.
pub(crate) fn setpoints(axes: &[Axis]) -> MotorVec {
    let mut setpoints = MotorVec::default();
    setpoints
        .iter_mut()
        .zip(axes)
        .for_each(|(to, axis)| *to = axis.setpoint());
    setpoints
}

fn require(right: bool, refusal: Refusal) -> Result<(), Refusal> {
    if right { Ok(()) } else { Err(refusal) }
}

fn extend<const N: usize>(
    before: Option<&Trend<N>>,
    goal: [f64; N],
    command: &ServoCommand,
) -> Trend<N> {
    before.map_or_else(
        || Trend::first(goal, command.stamp),
        |trend| trend.next(goal, command.stamp),
    )
}

/// The entries that the client sent, filled up with 0.
fn first<const N: usize>(mut values: [f64; N], entries: u32) -> [f64; N] {
    values
        .iter_mut()
        .skip(entries as usize)
        .for_each(|value| *value = 0.0);
    values
}

/// Not a number is not below any limit.
fn distance(a: &OutputVec, b: &OutputVec) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

fn largest_step(a: &[f64; MAX_MOTORS], b: &[f64; MAX_MOTORS]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}
