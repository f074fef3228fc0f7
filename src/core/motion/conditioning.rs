//! Conditioning cycle: motion that erases the unknown past of the wires.
//!
//! Friction and backlash remember the reversal points of the motors. A reversal point is forgotten
//! as soon as the motor moves past it (I. D. Mayergoyz 1986, the wiping-out property). The cycle
//! starts with one round through all reversal points of a region, so that nothing older survives,
//! and continues with shrinking rounds, like the demagnetisation of a magnet. The remaining memory
//! is small, even, and the same every time.
//!
//! - The reversal points of later rounds shrink evenly towards the start of the cycle. The cycle
//!   ends where it began, in the middle of the region or not.
//! - Between two reversal points the setpoint moves along a line under a limiter of its own, slower
//!   than the limits of the motors. It rests at each end for long enough that the encoder is read
//!   there.

use serde::{Deserialize, Serialize};

use crate::core::motion::conditioning_plan::{ConditioningPlan, ReversalPoints};
use crate::core::motion::velocity_limit::{MotorTarget, VelocityLimiter};
use crate::core::vector::{difference, interpolate, largest_difference};
use crate::model::Model;
use crate::robot::Refusal;
use crate::units::{MAX_MOTORS, MotorVec};

/// A setpoint this near to the end of a line is at its end, counts.
const END_TOLERANCE: f64 = 1e-6;

/// A conditioning cycle in progress.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct ConditioningCycle {
    /// Client that requested it.
    pub client_id: u64,
    start: MotorVec,
    points: ReversalPoints,
    rounds: u32,
    dwell_ticks: u32,
    /// Number of the present line.
    line: u32,
    from: MotorVec,
    to: MotorVec,
    /// Along the line, counts of the motor that moves furthest.
    limiter: VelocityLimiter,
    length: f64,
    /// Ticks spent at the end of the line.
    rested: u32,
    /// Counts.
    pub position: MotorVec,
    increment: MotorVec,
}

impl ConditioningCycle {
    /// A cycle that starts at given setpoints. [`Refusal::Range`] if the position limits leave less
    /// room than the model needs to forget.
    pub(crate) fn new(
        client_id: u64,
        plan: &ConditioningPlan,
        start: MotorVec,
        model: Option<&Model>,
    ) -> Result<Self, Refusal> {
        let cycle = Self {
            client_id,
            start,
            points: plan.reversal_points(&start, model)?,
            rounds: plan.rounds,
            dwell_ticks: plan.dwell_ticks,
            line: 0,
            from: start,
            to: start,
            limiter: plan.limiter,
            length: 0.0,
            rested: 0,
            position: start,
            increment: MotorVec::default(),
        };
        Ok(cycle.start_line(0))
    }

    /// One tick later; `None` once the cycle has ended where it began.
    pub(crate) fn after_tick(mut self) -> Option<Self> {
        let has_arrived = self.limiter.is_at_rest()
            && (self.length - self.limiter.position()).abs() < END_TOLERANCE;
        if has_arrived && self.rested >= self.dwell_ticks {
            return (self.line < self.last_line()).then(|| self.start_line(self.line + 1));
        }
        self.rested = if has_arrived { self.rested + 1 } else { 0 };
        self.limiter.track(MotorTarget::fixed(self.length));
        let fraction =
            if self.length > 0.0 { (self.limiter.position() / self.length).min(1.0) } else { 1.0 };
        let before = self.position;
        self.position = interpolate(&self.from, &self.to, fraction);
        self.increment = difference(&self.position, &before);
        Some(self)
    }

    /// The points between which the first round moves.
    pub(crate) fn corners(&self) -> impl Iterator<Item = &MotorVec> {
        (0..self.points.count).filter_map(|number| self.points.get(number))
    }

    /// Targets of the motors in this tick.
    pub(crate) fn targets(&self) -> [MotorTarget; MAX_MOTORS] {
        MotorTarget::from_vectors(&self.position, &self.increment)
    }

    /// The line back to the start.
    fn last_line(&self) -> u32 {
        self.rounds.saturating_mul(self.points.count)
    }

    fn start_line(mut self, line: u32) -> Self {
        (self.line, self.rested) = (line, 0);
        self.from = self.position;
        self.to = self.end_of(line);
        self.increment = MotorVec::default();
        self.length = largest_difference(&self.to, &self.from);
        self.limiter.restart(0.0);
        self
    }

    /// The first round goes to the reversal points themselves. Later rounds shrink towards the
    /// start. The last line ends there.
    fn end_of(&self, line: u32) -> MotorVec {
        let (count, last) = (self.points.count.max(1), self.last_line());
        if line >= last {
            return self.start;
        }
        let shrunk = (line + 1).saturating_sub(count);
        let fraction =
            1.0 - f64::from(shrunk) / f64::from(last.saturating_sub(count).saturating_add(1));
        let point = self.points.get(line).unwrap_or(&self.start);
        interpolate(&self.start, point, fraction)
    }
}
