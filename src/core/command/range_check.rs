//! Range check: the goals that a servo command may request. Checks 11 to 14 of `admission`.

use crate::config::CommandConfig;
use crate::core::command::client_stream::FollowedCommand;
use crate::core::inputs::{ServoCommand, ServoGoal};
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::goal_extrapolation::{ExtrapolatedGoal, GoalExtrapolation};
use crate::core::motion::joint_model::JointModel;
use crate::core::motion::reach::{Reached, WHOLE, nearest};
use crate::core::vector::{distance, first_entries, interpolate, largest_difference, zip_map};
use crate::model::file::OutputUnit;
use crate::robot::{Clip, Measurement, Quantity, Refusal};
use crate::units::{Counts, MAX_MOTORS, MAX_OUTPUTS, MotorVec, Nanos, OutputVec};

/// Rounding of degrees to radians must not refuse a step of exactly the limit.
const STEP_MARGIN: f64 = 1.0 + 1e-9;

/// Time for the first line of an interpolated stream, and the minimum for each: a burst does not
/// define a speed.
const FIRST_LINE: Nanos = Nanos::from_millis(100);
const MIN_LINE_TIME: Nanos = Nanos::from_millis(5);

/// The largest steps from one command to the next.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RangeCheck {
    followed: LargestStep,
    /// Maximum distance from the present setpoint to the first command of a stream, also after a
    /// pause, a stop and a fault.
    first: LargestStep,
}

#[derive(Debug, Clone, Copy)]
struct LargestStep {
    /// Length, rad.
    joint: f64,
    /// Limit per motor, counts.
    actuator: f64,
}

impl LargestStep {
    fn of(&self, unit: OutputUnit) -> f64 {
        match unit {
            OutputUnit::Deg => self.joint,
            OutputUnit::Mm => self.actuator,
        }
    }
}

impl RangeCheck {
    pub(crate) fn new(config: &CommandConfig) -> Self {
        Self {
            followed: LargestStep {
                joint: config.max_step_deg.to_radians(),
                actuator: f64::from(config.max_step_counts),
            },
            first: LargestStep {
                joint: config.first_step_deg.min(config.max_step_deg).to_radians(),
                actuator: config.first_step_counts(),
            },
        }
    }

    fn largest(&self, is_first: bool) -> &LargestStep {
        if is_first { &self.first } else { &self.followed }
    }

    /// The largest step of a motor, counts.
    pub(crate) fn largest_counts(&self, is_first: bool) -> f64 {
        self.largest(is_first).actuator
    }

    /// Checks the goal of a command. Returns the goal to follow: the continuation of the followed
    /// goal if it is of the same kind, or a new one, which must begin near the present setpoints.
    /// Angles out of reach become the nearest ones in reach.
    pub(crate) fn check(&self, goal: &UncheckedGoal<'_>) -> Result<CheckedGoal, Refusal> {
        let UncheckedGoal { command, deadline, followed, axes, joints, now } = *goal;
        match command.goal {
            ServoGoal::Joint(values, entries)
            | ServoGoal::Interpolated(values, entries)
            | ServoGoal::Rate(values, entries) => {
                let joints = joints.ok_or(Refusal::NoModel)?;
                require(entries as usize == joints.outputs(), Refusal::Malformed)?;
                let joint = JointCheck {
                    check: self,
                    stamp: command.stamp,
                    deadline,
                    now,
                    // An open clutch asks for the present setpoint, wherever the hand is.
                    before: followed.filter(|_| !command.clutched).and_then(FollowedCommand::joint),
                    border: followed.map_or(WHOLE, |followed| followed.border),
                    axes,
                    joints,
                };
                let values = first_entries::<MAX_OUTPUTS>(values, entries);
                match command.goal {
                    ServoGoal::Rate(..) => joint.rate(&values),
                    ServoGoal::Interpolated(..) => joint.interpolated(values),
                    _ => joint.angles(values),
                }
            }
            ServoGoal::Actuator(counts, entries) => {
                let before = match followed.map(|followed| &followed.goal) {
                    Some(ExtrapolatedGoal::Actuator(before)) => Some(before),
                    Some(ExtrapolatedGoal::Joint(_)) | None => None,
                };
                require(entries as usize == axes.count(), Refusal::Malformed)?;
                require(axes.allow(&counts), Refusal::Range)?;
                let counts = first_entries::<MAX_MOTORS>(counts.map(Counts::as_f64), entries);
                let from = before.map_or_else(|| axes.setpoints(), |before| before.goal);
                let largest = self.largest(before.is_none());
                require(
                    largest_difference(&counts, &from) <= largest.actuator,
                    Refusal::StepTooLarge,
                )?;
                Ok(CheckedGoal {
                    goal: ExtrapolatedGoal::Actuator(extend(before, counts, command.stamp)),
                    requested: OutputVec::default(),
                    border: WHOLE,
                    limit: None,
                })
            }
            // With a model of pitch and yaw they have become goals in joints.
            ServoGoal::Tip(..) | ServoGoal::TipRate(..) => {
                Err(joints.map_or(Refusal::NoModel, |_| Refusal::Unsupported))
            }
        }
    }

    /// The step of a command that is refused for it, and the limit. Only in angles or counts: the
    /// motors of a tip position are not what the client commands.
    pub(crate) fn step_measurement(&self, goal: &UncheckedGoal<'_>) -> Option<Measurement> {
        let UncheckedGoal { command, deadline, followed, axes, joints, .. } = *goal;
        match command.goal {
            ServoGoal::Rate(rate, entries) => {
                let way = first_entries::<MAX_OUTPUTS>(rate, entries)
                    .map(|rate| rate * deadline.as_seconds());
                let step = distance(&way, &OutputVec::default()).to_degrees();
                let limit = Some(self.followed.joint.to_degrees());
                Some(Measurement::new(Quantity::Degrees, step, limit))
            }
            ServoGoal::Tip(..) | ServoGoal::TipRate(..) => None,
            ServoGoal::Joint(angles, entries) | ServoGoal::Interpolated(angles, entries) => {
                let joints = joints.filter(|joints| joints.unit() == OutputUnit::Deg)?;
                let angles = first_entries::<MAX_OUTPUTS>(angles, entries);
                let (step, limit) = match followed.and_then(FollowedCommand::joint) {
                    Some((_, requested)) => (distance(&angles, requested), self.followed.joint),
                    None => (distance(&angles, &joints.setpoint()?), self.first.joint),
                };
                let limit = Some(limit.to_degrees());
                Some(Measurement::new(Quantity::Degrees, step.to_degrees(), limit))
            }
            ServoGoal::Actuator(counts, entries) => {
                let (from, is_first) = match followed.map(|followed| &followed.goal) {
                    Some(ExtrapolatedGoal::Actuator(before)) => (before.goal, false),
                    Some(ExtrapolatedGoal::Joint(_)) | None => (axes.setpoints(), true),
                };
                let counts = first_entries::<MAX_MOTORS>(counts.map(Counts::as_f64), entries);
                let step = largest_difference(&counts, &from);
                let limit = Some(self.largest(is_first).actuator);
                Some(Measurement::new(Quantity::Counts, step, limit))
            }
        }
    }
}

#[derive(Clone, Copy)]
pub(crate) struct UncheckedGoal<'a> {
    pub command: &'a ServoCommand,
    pub deadline: Nanos,
    pub followed: Option<&'a FollowedCommand>,
    pub axes: &'a AxisGroup,
    pub joints: Option<&'a JointModel>,
    /// Start of the tick.
    pub now: Nanos,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct CheckedGoal {
    pub goal: ExtrapolatedGoal,
    /// See [`FollowedCommand`].
    pub requested: OutputVec,
    pub border: f64,
    pub limit: Option<(Clip, f64)>,
}

struct JointCheck<'a> {
    check: &'a RangeCheck,
    stamp: Nanos,
    deadline: Nanos,
    /// Start of the tick.
    now: Nanos,
    /// The followed goal and the requested goal.
    before: Option<(&'a GoalExtrapolation<MAX_OUTPUTS>, &'a OutputVec)>,
    border: f64,
    axes: &'a AxisGroup,
    joints: &'a JointModel,
}

impl JointCheck<'_> {
    fn angles(&self, angles: OutputVec) -> Result<CheckedGoal, Refusal> {
        self.require_step(&angles)?;
        let reached = self.reached(&angles)?;
        let goal = extend(self.before.map(|it| it.0), reached.goal, self.stamp);
        Ok(passed(goal, angles, &reached))
    }

    /// The line to the goal is as long in time as the last one was.
    fn interpolated(&self, angles: OutputVec) -> Result<CheckedGoal, Refusal> {
        self.require_step(&angles)?;
        let (from, reached) = (self.present()?, self.reached(&angles)?);
        let interval = match self.before {
            Some((before, _)) => self.stamp.duration_since(before.stamp).max(MIN_LINE_TIME),
            None => FIRST_LINE,
        };
        let after = interval.min(self.deadline);
        let goal = GoalExtrapolation::reaching(reached.goal, &from, self.stamp, after);
        Ok(passed(goal, angles, &reached))
    }

    /// A rate is integrated until its deadline or the border, starting at the end of the followed
    /// command or at its own arrival. Earlier requests have expired.
    fn rate(&self, rate: &OutputVec) -> Result<CheckedGoal, Refusal> {
        require(self.joints.unit() == OutputUnit::Deg, Refusal::Unsupported)?;
        let deadline_s = self.deadline.as_seconds();
        let way = rate.map(|rate| rate * deadline_s);
        let (length, first) = (distance(&way, &OutputVec::default()), self.check.first.joint);
        require(length <= self.check.followed.joint * STEP_MARGIN, Refusal::StepTooLarge)?;
        let mut from = self.present()?;
        let mut begin = self.stamp.max(self.now);
        if let Some((before, _)) = self.before {
            begin = self.stamp.max(before.stamp);
            // The goal does not run ahead of a snake that cannot keep up, or it would continue
            // after the rate is zero.
            let left = self.joints.remaining_motion(&self.axes.setpoints());
            let left = left.map_err(|_| Refusal::BadModel)?;
            let ahead = distance(&left, &OutputVec::default());
            let most = length + first + self.joints.dead_band_width();
            let back = if ahead > most { 1.0 - most / ahead } else { 0.0 };
            from = zip_map(&from, &left, |from, left| from - back * left);
        }
        let left = self.deadline.duration_since(begin.duration_since(self.stamp)).max(Nanos(1));
        let to = zip_map(&from, rate, |from, rate| from + rate * left.as_seconds());
        let reached = self.reached(&to)?;
        if reached.limit.is_none() {
            let goal = GoalExtrapolation::moving(from, *rate, begin, left.as_seconds());
            return Ok(passed(goal, from, &reached));
        }
        // Along the border, with what is left of the rate.
        let goal = GoalExtrapolation::reaching(reached.goal, &from, begin, left);
        Ok(passed(goal, to, &reached))
    }

    /// Where the followed goal is when the command is sent; the setpoint if there is none.
    fn present(&self) -> Result<OutputVec, Refusal> {
        let goal = self.before.map(|(goal, _)| goal.at(self.stamp));
        goal.or(self.joints.setpoint()).ok_or(Refusal::DrivesNotReady)
    }

    /// The nearest goal in reach. It goes no further than the hand, and the first step of a stream
    /// more: a border that is elsewhere at once, as of another model, does not take the goal along.
    fn reached(&self, asked: &OutputVec) -> Result<Reached, Refusal> {
        let moved = self.before.map_or(0.0, |(_, requested)| distance(asked, requested));
        let reached = nearest(self.joints, self.axes, asked, (self.border, moved));
        let mut reached = reached.map_err(|_| Refusal::BadModel)?;
        let Some((before, requested)) = self.before else { return Ok(reached) };
        if reached.limit.is_some() || before.goal != *requested {
            let most = self.apart(asked, requested)? + self.check.first.of(self.joints.unit());
            let present = self.present()?;
            let share = most / self.apart(&reached.goal, &present)?;
            reached.goal = interpolate(&present, &reached.goal, share);
        }
        Ok(reached)
    }

    /// The step of the hand, which must be short: from the last request, or from the setpoint.
    fn require_step(&self, goal: &OutputVec) -> Result<(), Refusal> {
        let largest = self.check.largest(self.before.is_none()).of(self.joints.unit());
        let step = match self.before {
            Some((_, requested)) => self.apart(goal, requested)?,
            None => match self.joints.unit() {
                OutputUnit::Deg => {
                    distance(goal, &self.joints.setpoint().ok_or(Refusal::DrivesNotReady)?)
                }
                OutputUnit::Mm => largest_difference(&self.counts(goal)?, &self.axes.setpoints()),
            },
        };
        // A distance that is not a number is not allowed.
        require(step <= largest * STEP_MARGIN, Refusal::StepTooLarge)
    }

    /// Angles are compared as angles. The position of a tip has no degrees, so the motor positions
    /// of its inverse are compared.
    fn apart(&self, one: &OutputVec, other: &OutputVec) -> Result<f64, Refusal> {
        match self.joints.unit() {
            OutputUnit::Deg => Ok(distance(one, other)),
            OutputUnit::Mm => Ok(largest_difference(&self.counts(one)?, &self.counts(other)?)),
        }
    }

    fn counts(&self, goal: &OutputVec) -> Result<MotorVec, Refusal> {
        self.joints.solve(goal).map(|inverse| inverse.counts).map_err(|_| Refusal::StepTooLarge)
    }
}

fn passed(
    goal: GoalExtrapolation<MAX_OUTPUTS>,
    requested: OutputVec,
    reached: &Reached,
) -> CheckedGoal {
    let Reached { border, limit, .. } = *reached;
    CheckedGoal { goal: ExtrapolatedGoal::Joint(goal), requested, border, limit }
}

pub(crate) fn require(is_met: bool, refusal: Refusal) -> Result<(), Refusal> {
    if is_met { Ok(()) } else { Err(refusal) }
}

/// The next goal of a stream, or the first.
pub(crate) fn extend<const N: usize>(
    before: Option<&GoalExtrapolation<N>>,
    goal: [f64; N],
    stamp: Nanos,
) -> GoalExtrapolation<N> {
    match before {
        Some(before) => before.next(goal, stamp),
        None => GoalExtrapolation::first(goal, stamp),
    }
}
