//! The gate: the last stage before the drives, and the only way to them.
//!
//! # The order of filters
//!
//! A goal passes these stages in this order, and in no other:
//!
//! | | stage | what it may move |
//! |---|---|---|
//! | 0 | `command/goals` | a place or a velocity of the tip becomes one of the joints |
//! | 1 | `command/goals` | the goal of the master becomes one of the snake |
//! | 2 | `motion/reach` | the goal, or the nearest pose in reach |
//! | 3 | `motion/goal_extrapolation` | the goal between commands, or a rate integrated |
//! | 4 | `motion/joint_filter` | the goal |
//! | 5 | `motion/joint_limits` | the goal: position, velocity, acceleration, jerk of the angles |
//! | 6 | `motion/virtual_fixtures` | the goal, within the limits of stage 5 |
//! | 7 | `motion/pipeline`, dead-band | the goal |
//! | 8 | `motion/pipeline`, blend | the goal, after a swap of the model |
//! | 9 | inverse of the model, correction of the adaptation, position limits of the axes | counts |
//! | 10 | `motion/velocity_limit` | the setpoints |
//! | 11 | the gate | a setpoint that breaks a limit is slowed down, or stops |
//!
//! `motion/pipeline` runs stages 4 to 8. A goal is made in stages 0 to 3, and begins at the
//! setpoint only while nothing is followed. Nothing that a later stage adds to it on purpose (the
//! lead, the dead-band, the blend, what is not compensated) feeds back to there: the goal would run
//! away from itself.
//!
//! Stages 6 to 10 may undo what an earlier one has limited. So nothing relies on the order: the
//! gate checks the setpoints that the motors would get, whichever activity they come from, and
//! checks every limit on them:
//!
//! - position limits, velocity and acceleration of every motor;
//! - position limits of the angles, their velocity, and the change of their velocity over the time
//!   that a line takes to carry a setpoint ([`JointBounds`](super::joint_limits::JointBounds));
//! - the distance to every region, as adapted and as calibrated;
//! - the calibrated hull, while a goal in joint space is followed.
//!
//! Stage 5 limits acceleration and jerk of the goal. Those of the setpoints per tick are not
//! limited: at the end of a gap the tip starts at once, however slowly the motor moves, and neither
//! a drive nor the snake sees less than the time of a line. A motor crosses a gap as fast as it
//! can, and reaches its end as slowly as the limit of the tip asks.
//!
//! Positions are those of the setpoints, and those at which the motors come to rest if they stop in
//! the next tick: what passes can always stop in time, and motors that do not stop at the same time
//! leave the line between both. A limit that is broken already may be broken no further. What slows
//! down always passes: the gate never lengthens a stop.
//!
//! A setpoint that fails is tried again on a straight line and with one motor after the other, each
//! as fast as the limits allow. If nothing passes that moves a motor, the motors stop, and
//! [`Passed::blocked_by`] names the limit that has kept them for [`BLOCKED_TIMEOUT`]. The number of
//! trials is fixed, and so is the time of a tick.
//!
//! A request to a drive that has passed is a [`Gated`]. The port threads take nothing else, and
//! only this file makes one.

mod joint_space;

use std::ops::Deref;

use serde::{Deserialize, Serialize};

use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::joint_limits::MAX_LINE_TICKS;
use crate::core::motion::joint_model::NotFinite;
use crate::core::motion::velocity_limit::MotorTarget;
use crate::core::vector::{collect, difference};
use crate::drive::{AxisRequest, Demand};
use crate::robot::Stop;
use crate::units::{MAX_AXES, MAX_MOTORS, MotorVec, Nanos, OutputVec};
pub(crate) use joint_space::JointSpace;
use joint_space::Poses;

/// Distance from its target up to which a setpoint has no way to go, counts; and up to which one
/// that does not move has arrived.
const MAX_AWAY: f64 = 1.0;
const MAX_ARRIVED: f64 = 0.01;
/// Time without a change of any setpoint after which a motion at a limit ends.
const BLOCKED_TIMEOUT: Nanos = Nanos::from_millis(1000);

/// A request to a drive that has passed the gate.
///
/// It is also read back from black boxes; those values are not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Gated(AxisRequest);

impl Deref for Gated {
    type Target = AxisRequest;

    fn deref(&self) -> &AxisRequest {
        &self.0
    }
}

impl From<Gated> for AxisRequest {
    fn from(gated: Gated) -> Self {
        gated.0
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Motion {
    /// Slow down as hard as allowed, and stay.
    Stop,
    /// Move towards targets. `in_hull`: not out of the calibrated hull.
    Track { targets: [MotorTarget; MAX_MOTORS], in_hull: bool },
}

/// The setpoints of a tick have passed, or were held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Passed {
    /// The limit that keeps setpoints from their targets.
    held_by: Option<Stop>,
    /// It has done so for [`BLOCKED_TIMEOUT`], without any motion.
    is_blocked: bool,
}

impl Passed {
    /// The setpoints moved less than requested and are not at their target.
    pub(crate) fn is_held(self) -> bool {
        self.held_by.is_some()
    }

    /// The limit at which motors with a way to go have stood for [`BLOCKED_TIMEOUT`].
    pub(crate) fn blocked_by(self) -> Option<Stop> {
        self.held_by.filter(|_| self.is_blocked)
    }

    pub(crate) fn requests(
        self,
        axes: &AxisGroup,
        demands: &[Demand; MAX_AXES],
        common: &AxisRequest,
    ) -> [Gated; MAX_MOTORS] {
        axes.requests(demands, common).map(Gated)
    }
}

/// The gate, with the motion that it let through last.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Gate {
    /// The last steps of the pose, newest first, rad.
    steps: [OutputVec; MAX_LINE_TICKS],
    /// Ticks in which no setpoint has changed, although one has a way to go; and the most of them.
    stood: u32,
    max_stood: u32,
}

struct GateTick<'a> {
    before: [Option<AxisControl>; MAX_MOTORS],
    /// The setpoints before, and where they come to rest in a stop, counts.
    setpoints: MotorVec,
    stopped: MotorVec,
    rest: MotorVec,
    /// The setpoints may not leave the calibrated hull.
    in_hull: bool,
    space: Option<JointSpace<'a>>,
}

/// Result of an attempt. What is too fast passes with this share of its velocity, if it passes.
enum Verdict {
    Passes { step: OutputVec },
    TooFast { share: f64 },
    Fails(Stop),
}

/// Trials of a tick; the later ones only where a limit is reached. Each may come twice: as fast as
/// the motors can, and slower where that is too fast.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Attempt {
    All,
    Straight,
    /// Where both motors cannot move together: away from a border that gaps of different width lead
    /// across, and where one motor would be too fast at the end of its gap.
    First,
    Second,
}

const ATTEMPTS: [Attempt; 4] = [Attempt::All, Attempt::Straight, Attempt::First, Attempt::Second];

impl Attempt {
    fn shares(self, axes: &AxisGroup, targets: &[MotorTarget; MAX_MOTORS]) -> MotorVec {
        match self {
            Self::All => [1.0; MAX_MOTORS],
            Self::Straight => axes.straight_shares(targets),
            Self::First => [1.0, 0.0],
            Self::Second => [0.0, 1.0],
        }
    }

    /// Where the motion of one motor alone ends, counts.
    fn leads_to(self, from: &MotorVec, targets: &[MotorTarget; MAX_MOTORS]) -> Option<MotorVec> {
        let motor = match self {
            Self::All | Self::Straight => return None,
            Self::First => 0,
            Self::Second => 1,
        };
        let mut end = *from;
        end[motor] = targets[motor].position;
        Some(end)
    }
}

impl Gate {
    pub(crate) fn new(tick: Nanos) -> Self {
        let max_stood = (BLOCKED_TIMEOUT.0 / tick.0.max(1)) as u32;
        Self { steps: [OutputVec::default(); MAX_LINE_TICKS], stood: 0, max_stood }
    }

    /// The motion was not followed: the setpoints have not moved.
    pub(crate) fn keep(&mut self) -> Passed {
        self.note(OutputVec::default());
        Passed { held_by: None, is_blocked: false }
    }

    /// Moves the setpoints by one tick, and lets nothing pass that breaks a limit.
    pub(crate) fn pass(
        &mut self,
        axes: &mut AxisGroup,
        motion: &Motion,
        space: Option<JointSpace<'_>>,
    ) -> Result<Passed, NotFinite> {
        let Motion::Track { targets, in_hull } = motion else {
            self.stood = 0;
            let step = GateTick::new(axes, false, space).stop(axes)?;
            self.note(step);
            return Ok(Passed { held_by: None, is_blocked: false });
        };
        let before = axes.targets();
        let mut tick = GateTick::new(axes, *in_hull, space);
        let (held_by, step) = tick.attempts(axes, targets, self)?;
        self.note(step);
        let held_by = held_by.filter(|_| axes.is_away_from(targets, MAX_AWAY));
        let is_standing = held_by.is_some() && axes.targets() == before;
        self.stood = if is_standing { self.stood + 1 } else { 0 };
        Ok(Passed { held_by, is_blocked: self.stood >= self.max_stood })
    }

    /// Moves the setpoint of the auxiliary axis by one tick; `target`: `None` for a stop.
    pub(crate) fn pass_auxiliary(
        axis: &mut AxisControl,
        target: Option<MotorTarget>,
        demand: Demand,
        common: &AxisRequest,
    ) -> Gated {
        let before = *axis;
        if let Some(target) = target {
            axis.track(target, 1.0);
        }
        if target.is_none() || !axis.keeps_limits(&before) {
            *axis = before;
            axis.stop();
        }
        Gated(axis.request(demand, common))
    }

    fn note(&mut self, step: OutputVec) {
        self.steps.rotate_right(1);
        self.steps[0] = step;
    }
}

impl<'a> GateTick<'a> {
    fn new(axes: &AxisGroup, in_hull: bool, space: Option<JointSpace<'a>>) -> Self {
        let before = axes.to_snapshot();
        let stopped = before.map(|axis| {
            axis.map(|mut axis| {
                axis.stop();
                axis
            })
        });
        let values = |of: fn(&AxisControl) -> f64| collect(stopped.iter().flatten().map(of));
        Self {
            before,
            setpoints: axes.setpoints(),
            stopped: values(AxisControl::setpoint),
            rest: values(AxisControl::rest_position),
            in_hull,
            space,
        }
    }

    /// Moves the motors as far as the limits let them. Returns the step of the pose, and the limit
    /// that reduced the motion.
    fn attempts(
        &mut self,
        axes: &mut AxisGroup,
        targets: &[MotorTarget; MAX_MOTORS],
        gate: &Gate,
    ) -> Result<(Option<Stop>, OutputVec), NotFinite> {
        let mut held_by = None;
        for attempt in ATTEMPTS {
            let mut shares = attempt.shares(axes, targets);
            let leads_to = attempt.leads_to(&self.setpoints, targets);
            for _ in 0..2 {
                axes.track(targets, &shares);
                let (limit, share) = match self.judge(axes, gate, leads_to.as_ref())? {
                    Verdict::Passes { step }
                        if axes.is_moving() || !axes.is_away_from(targets, MAX_ARRIVED) =>
                    {
                        return Ok((held_by, step));
                    }
                    Verdict::Passes { .. } => (None, 0.0),
                    Verdict::TooFast { share } => (Some(Stop::Speed), share),
                    Verdict::Fails(limit) => (Some(limit), 0.0),
                };
                // A border is named before a speed that was too high; that of a detour is not.
                let border = held_by.filter(|it| *it != Stop::Speed || leads_to.is_some());
                held_by = border.or(limit).or(held_by);
                axes.restore(&self.before);
                if share <= 0.0 {
                    break;
                }
                shares = shares.map(|whole| share * whole);
            }
        }
        Ok((held_by.or(Some(Stop::Limit)), self.stop(axes)?))
    }

    /// Stops the motors. Returns the step of the pose.
    fn stop(&self, axes: &mut AxisGroup) -> Result<OutputVec, NotFinite> {
        axes.for_each(AxisControl::stop);
        match &self.space {
            Some(space) if axes.is_moving() && space.joints.bounds().is_some() => {
                let poses = Poses::new(space.joints, &self.setpoints);
                Ok(difference(&poses.at(&self.stopped)?, &poses.at(&self.setpoints)?))
            }
            _ => Ok(OutputVec::default()),
        }
    }

    /// Checks the setpoints against every limit.
    fn judge(
        &mut self,
        axes: &AxisGroup,
        gate: &Gate,
        leads_to: Option<&MotorVec>,
    ) -> Result<Verdict, NotFinite> {
        if !axes.keep_limits(&self.before) {
            return Ok(Verdict::Fails(Stop::Limit));
        }
        // Each with where it would be in a stop.
        let (rest, here) = ((axes.rest_positions(), self.rest), (axes.setpoints(), self.stopped));
        let places = [rest, here];
        let Some(space) = &mut self.space else {
            return Ok(Verdict::Passes { step: OutputVec::default() });
        };
        if self.in_hull && !places.iter().all(|(at, stop)| space.stays_in_hull(at, stop)) {
            return Ok(Verdict::Fails(Stop::Hull));
        }
        let speed = self.judge_speed(axes, gate)?;
        let Some(space) = &mut self.space else { return Ok(speed) };
        if let Verdict::Passes { .. } = speed {
            for (at, stop) in &places {
                if let Some(limit) = space.forbids(at, stop, leads_to)? {
                    return Ok(Verdict::Fails(limit));
                }
            }
        }
        Ok(speed)
    }

    /// The step of this tick, and the way to rest after it: a gap that ends on that way may not
    /// make the tip start faster than the step may be.
    fn judge_speed(&self, axes: &AxisGroup, gate: &Gate) -> Result<Verdict, NotFinite> {
        let joints = self.space.as_ref().map(|space| space.joints);
        let Some((joints, bounds)) = joints.and_then(|joints| Some((joints, joints.bounds()?)))
        else {
            return Ok(Verdict::Passes { step: OutputVec::default() });
        };
        let poses = Poses::new(joints, &self.setpoints);
        let (at, rest) = (axes.setpoints(), axes.rest_positions());
        let (from, here) = (poses.at(&self.setpoints)?, poses.at(&at)?);
        let step = difference(&here, &from);
        let way = difference(&poses.at(&rest)?, &here);
        let longest = bounds.longest_step(&step, &gate.steps);
        let farthest = bounds.longest_way(&way, &step, &gate.steps, axes.ticks_to_rest());
        let pairs = || [(step, longest), (way, farthest)].into_iter();
        let is_kept = |(is, most): (OutputVec, OutputVec)| {
            is.iter().zip(&most).all(|(is, most)| is.abs() <= *most)
        };
        if pairs().all(is_kept) {
            return Ok(Verdict::Passes { step });
        }
        let stopped = poses.at(&self.stopped)?;
        let least = [difference(&stopped, &from), difference(&poses.at(&self.rest)?, &stopped)];
        let mut share = 1.0_f64;
        for ((is, most), least) in pairs().zip(&least) {
            for ((is, most), least) in is.iter().zip(&most).zip(least) {
                if is.abs() > *most {
                    share = share.min((most.copysign(*is) - least) / (is - least));
                }
            }
        }
        Ok(Verdict::TooFast { share: 0.999 * share })
    }
}
