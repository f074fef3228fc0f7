//! The gate: the last stage before the drives, and the only way to them.
//!
//! # The order of filters
//!
//! A goal passes these stages in this order, and in no other:
//!
//! | | stage | what it may move |
//! |---|---|---|
//! | 0 | `command/tip_goal` | a place or a velocity of the tip becomes one of the joints |
//! | 1 | `command/clutch` | the goal of the master becomes one of the snake |
//! | 2 | `motion/reach` | the goal, back on its line to what can be reached |
//! | 3 | `motion/goal_extrapolation` | the goal between commands: extrapolated, interpolated, or a rate integrated |
//! | 4 | `motion/tremor_filter`, `motion/goal_lead` | the goal |
//! | 5 | `motion/joint_limits` | the goal: position, velocity, acceleration, jerk of the angles |
//! | 6 | `motion/virtual_fixtures` | the goal, within the limits of stage 5 |
//! | 7 | `motion/backlash_dead_band` | the goal |
//! | 8 | `motion/model_blend` | the goal, after a swap of the model |
//! | 9 | inverse of the model, correction of the adaptation, position limits of the axes | counts |
//! | 10 | `motion/velocity_limit`, `motion/jerk_limit` | the setpoints |
//! | 11 | the gate | a setpoint that breaks a limit is slowed down, or stops |
//!
//! A goal is made in stages 0 to 3, and begins at the setpoint only while nothing is followed.
//! Nothing that a later stage adds to it on purpose (the lead, the dead-band, the blend, what is
//! not compensated) feeds back to there: the goal would run away from itself.
//!
//! Stages 6 to 10 may undo what an earlier one has limited. So nothing relies on the order: the
//! gate looks at the setpoints that the motors would get, whichever activity they come from, and
//! checks every limit on them:
//!
//! - position limits, velocity and acceleration of every motor;
//! - position, velocity, acceleration and jerk of the angles ([`JointBounds`]);
//! - the distance to every region, as adapted and as calibrated;
//! - the calibrated hull, while a goal in joint space is followed.
//!
//! Positions are those of the setpoints, and those at which the motors come to rest if they stop in
//! the next tick: what passes can always stop in time, and motors that do not stop at the same time
//! leave the line between both. A limit that is broken already may be broken no further. What slows
//! down always passes: the gate never lengthens a stop.
//!
//! A setpoint that fails is tried again with less: slower, one motor without the other, on a
//! straight line. If nothing passes, the motors stop. The number of trials is fixed, and so is the
//! time of a tick.
//!
//! A request to a drive that has passed is a [`Gated`]. The port threads take nothing else, and
//! only this file makes one.

use std::ops::Deref;

use serde::{Deserialize, Serialize};

use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::joint_model::{JointModel, NotFinite};
use crate::core::motion::velocity_limit::MotorTarget;
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::vector::{collect, difference, zip_map};
use crate::drive::{AxisRequest, Demand};
use crate::model::Memory;
use crate::units::{MAX_AXES, MAX_MOTORS, MotorVec, OutputVec};

/// What the inverse leaves, and far less than a count: rad.
const POSE_TOLERANCE: f64 = 2e-5;
/// The same for the change of a step, rad per tick.
const STEP_TOLERANCE: f64 = 5e-7;
/// A step may be longer than its limit by this factor, so that a goal at the limit is not slowed
/// down by what the inverse leaves.
const STEP_MARGIN: f64 = 1.01;
/// The inverse lies in the hull, and the setpoint near it: counts.
const HULL_TOLERANCE: f64 = 1.0;

/// A request to a drive that has passed the gate.
///
/// It is read back from black boxes, too; those are not sent.
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

/// What the setpoints shall do in this tick.
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
    /// The setpoints moved less than asked.
    is_held: bool,
    /// They stop, although they were asked to move.
    is_stopped: bool,
}

impl Passed {
    pub fn is_held(self) -> bool {
        self.is_held
    }

    pub fn is_stopped(self) -> bool {
        self.is_stopped
    }

    /// The requests to the drives.
    pub fn requests(
        self,
        axes: &AxisGroup,
        demands: &[Demand; MAX_AXES],
        common: &AxisRequest,
    ) -> [Gated; MAX_MOTORS] {
        axes.requests(demands, common).map(Gated)
    }
}

/// The joint space of a tick.
pub(crate) struct JointSpace<'a> {
    pub joints: &'a JointModel,
    pub fixtures: &'a mut VirtualFixtures,
    /// The memory as calibrated, while the adaptation corrects the model.
    pub calibrated: Option<&'a Memory>,
}

/// Ticks over which the steps of the pose of a model with memory are compared: drives take whole
/// counts, so at half a count per tick every other step is another one.
const STEPS: usize = 8;

/// The gate, with the motion of the pose that it let through last.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Gate {
    /// The last steps of the pose, newest first, rad.
    steps: [OutputVec; STEPS],
    /// How much faster than those before it the newest one was.
    growth: OutputVec,
}

/// A tick at the gate.
struct GateTick<'a> {
    /// The axes before the tick.
    before: [Option<AxisControl>; MAX_MOTORS],
    /// The setpoints before, and where they come to rest in a stop, counts.
    setpoints: MotorVec,
    /// The last motion of the setpoints, counts.
    increments: MotorVec,
    stopped: MotorVec,
    rest: MotorVec,
    /// The setpoints may not leave the calibrated hull.
    in_hull: bool,
    space: Option<JointSpace<'a>>,
}

/// What an attempt came to.
enum Verdict {
    Passes {
        step: OutputVec,
    },
    /// It passes with this share of its velocity, if it passes.
    TooFast {
        share: f64,
    },
    Fails,
}

/// Trials of a tick; the later ones only where a limit is reached. Each may come twice: as fast as
/// the motors can, and as fast as the joint limits allow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Attempt {
    All,
    First,
    Second,
    Straight,
    Slowly,
}

const ATTEMPTS: [Attempt; 5] =
    [Attempt::All, Attempt::First, Attempt::Second, Attempt::Straight, Attempt::Slowly];

impl Attempt {
    /// The shares of the velocity of the motors.
    fn shares(self, axes: &AxisGroup, targets: &[MotorTarget; MAX_MOTORS]) -> MotorVec {
        match self {
            Self::All => [1.0; MAX_MOTORS],
            Self::First => [1.0, 0.0],
            Self::Second => [0.0, 1.0],
            Self::Straight => axes.straight_shares(targets),
            Self::Slowly => [0.1; MAX_MOTORS],
        }
    }
}

impl Gate {
    /// The motion was not followed: the setpoints have not moved.
    pub fn keep(&mut self) -> Passed {
        *self = Self::default();
        Passed { is_held: true, is_stopped: true }
    }

    /// Moves the setpoints by one tick, and lets nothing pass that breaks a limit.
    pub fn pass(
        &mut self,
        axes: &mut AxisGroup,
        motion: &Motion,
        space: Option<JointSpace<'_>>,
    ) -> Result<Passed, NotFinite> {
        let Motion::Track { targets, in_hull } = motion else {
            return Ok(self.stop(axes, false));
        };
        let mut tick = GateTick::new(axes, *in_hull, space);
        for attempt in ATTEMPTS {
            let mut shares = attempt.shares(axes, targets);
            for is_last in [false, true] {
                axes.track(targets, &shares);
                match tick.judge(axes, self)? {
                    Verdict::Passes { step } => {
                        // After a stop, in which the setpoints may still move.
                        if self.steps == [OutputVec::default(); STEPS] {
                            self.steps[0] = tick.last_step()?;
                        }
                        self.note(step, tick.compared());
                        let is_held = is_last || attempt != Attempt::All;
                        return Ok(Passed { is_held, is_stopped: false });
                    }
                    Verdict::TooFast { share } if !is_last && share > 0.0 => {
                        shares = shares.map(|whole| share * whole);
                        axes.take_back(&tick.before);
                    }
                    Verdict::TooFast { .. } | Verdict::Fails => break,
                }
            }
            axes.take_back(&tick.before);
        }
        Ok(self.stop(axes, true))
    }

    /// Moves the setpoint of an axis beside the joints by one tick; `target`: `None` for a stop.
    pub fn pass_alone(
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
        Gated(axis.request_with(demand, common))
    }

    fn stop(&mut self, axes: &mut AxisGroup, is_held: bool) -> Passed {
        *self = Self::default();
        axes.for_each(AxisControl::stop);
        Passed { is_held, is_stopped: is_held }
    }

    fn note(&mut self, step: OutputVec, compared: usize) {
        let last = self.step_like(&step, compared);
        self.growth = zip_map(&step, &last, |step, last| step.abs() - last.abs());
        self.steps.rotate_right(1);
        self.steps[0] = step;
    }

    /// The longest of so many last steps in the direction of a step, output by output; 0: none.
    fn step_like(&self, step: &OutputVec, compared: usize) -> OutputVec {
        self.steps.iter().take(compared).fold(OutputVec::default(), |longest, last| {
            let like = zip_map(last, step, |last, step| if last * step > 0.0 { last } else { 0.0 });
            zip_map(&longest, &like, |a, b| if b.abs() > a.abs() { b } else { a })
        })
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
            increments: axes.increments(),
            stopped: values(AxisControl::setpoint),
            rest: values(AxisControl::rest_position),
            in_hull,
            space,
        }
    }

    /// The steps that are compared.
    fn compared(&self) -> usize {
        let joints = self.space.as_ref().map(|space| space.joints);
        if joints.is_some_and(JointModel::has_memory) { STEPS } else { 1 }
    }

    /// The last step of the pose; 0 where nothing limits it.
    fn last_step(&self) -> Result<OutputVec, NotFinite> {
        let joints = self.space.as_ref().map(|space| space.joints);
        let joints = joints.filter(|joints| joints.bounds().is_some());
        match joints.filter(|_| self.increments != MotorVec::default()) {
            Some(joints) => {
                let before = difference(&self.setpoints, &self.increments);
                Ok(difference(&joints.pose(&self.setpoints)?, &joints.pose(&before)?))
            }
            None => Ok(OutputVec::default()),
        }
    }

    /// Checks the setpoints against every limit.
    fn judge(&mut self, axes: &AxisGroup, gate: &Gate) -> Result<Verdict, NotFinite> {
        if !axes.keep_limits(&self.before) {
            return Ok(Verdict::Fails);
        }
        // Each with where it would be in a stop.
        let (rest, here) = ((axes.rest_positions(), self.rest), (axes.setpoints(), self.stopped));
        let places = [rest, here];
        let Some(space) = &mut self.space else {
            return Ok(Verdict::Passes { step: OutputVec::default() });
        };
        if self.in_hull && !places.iter().all(|(at, stop)| space.stays_in_hull(at, stop)) {
            return Ok(Verdict::Fails);
        }
        let speed = self.judge_speed(axes, gate)?;
        let Some(space) = &mut self.space else { return Ok(speed) };
        if let Verdict::Passes { .. } = speed {
            for (at, stop) in &places {
                if !space.allows(at, stop)? {
                    return Ok(Verdict::Fails);
                }
            }
        }
        Ok(speed)
    }

    fn judge_speed(&self, axes: &AxisGroup, gate: &Gate) -> Result<Verdict, NotFinite> {
        let joints = self.space.as_ref().map(|space| space.joints);
        let Some((joints, bounds)) = joints.and_then(|joints| Some((joints, joints.bounds()?)))
        else {
            return Ok(Verdict::Passes { step: OutputVec::default() });
        };
        // Drives are at whole counts, and so is the memory. From between them the pose would rest
        // up to the count that has been sent, and begin anew from rest beyond it, count by count.
        let sent = self.setpoints.map(f64::round);
        let moved_to = |setpoints: &MotorVec| {
            let moved = difference(setpoints, &self.setpoints);
            joints.pose(&zip_map(&sent, &moved, |sent, moved| sent + moved))
        };
        let from = joints.pose(&sent)?;
        let step = difference(&moved_to(&axes.setpoints())?, &from);
        let last = gate.step_like(&step, self.compared());
        let largest = bounds.largest_step(&step, &last, &gate.growth, STEP_MARGIN);
        let largest = largest.map(|step| step + STEP_TOLERANCE);
        if step.iter().zip(&largest).all(|(step, largest)| step.abs() <= *largest) {
            return Ok(Verdict::Passes { step });
        }
        let slowest = difference(&moved_to(&self.stopped)?, &from);
        let mut share = 1.0_f64;
        for ((step, largest), slowest) in step.iter().zip(&largest).zip(&slowest) {
            if step.abs() > *largest {
                share = share.min((largest.copysign(*step) - slowest) / (step - slowest));
            }
        }
        Ok(Verdict::TooFast { share: 0.999 * share })
    }
}

impl JointSpace<'_> {
    /// Comparisons are written so that what is not a number fails.
    fn stays_in_hull(&self, at: &MotorVec, stop: &MotorVec) -> bool {
        let hull = self.joints.model().hull();
        hull.excess(at) <= HULL_TOLERANCE.max(hull.excess(stop))
    }

    /// The poses at some counts keep the position limits and stay out of all regions, or break them
    /// no further than a stop does.
    fn allows(&mut self, at: &MotorVec, stop: &MotorVec) -> Result<bool, NotFinite> {
        let (joints, calibrated) = (self.joints, self.calibrated);
        let bounds = joints.bounds();
        if bounds.is_none() && !self.fixtures.is_on() {
            return Ok(true);
        }
        let adapted = joints.pose(at)?;
        if let Some(bounds) = bounds {
            let excess = bounds.excess(&adapted);
            if excess > POSE_TOLERANCE && excess > bounds.excess(&joints.pose(stop)?) {
                return Ok(false);
            }
        }
        if !self.fixtures.is_on() {
            return Ok(true);
        }
        let as_calibrated = |counts, adapted| match calibrated {
            Some(memory) => joints.calibrated_pose(counts, memory),
            None => Ok(adapted),
        };
        let poses = [adapted, as_calibrated(at, adapted)?];
        let seen = if calibrated.is_some() { &poses[..] } else { &poses[..1] };
        self.fixtures.allow_setpoint(seen, joints.unit(), || {
            let stopped = joints.pose(stop)?;
            Ok([stopped, as_calibrated(stop, stopped)?])
        })
    }
}
