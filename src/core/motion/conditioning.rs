//! Conditioning cycle: motion that erases the unknown past of the wires.
//!
//! Friction and backlash remember the reversal points of the motors. A reversal point is forgotten
//! as soon as the motor moves past it (I. D. Mayergoyz 1986, the wiping-out property). The cycle
//! starts with one round through all reversal points of a region, so that nothing older survives,
//! and continues with shrinking rounds, like the demagnetisation of a magnet. The remaining memory
//! is small, even, and the same every time.
//!
//! - The reversal points are the lowest and the highest point of every motor in a region, in the
//!   order of one round. The region is convex, so straight lines between them do not leave it, and
//!   every motor covers its whole width.
//! - The reversal points of later rounds shrink evenly towards the start of the cycle. The cycle
//!   ends where it began, in the middle of the region or not.
//! - Between two reversal points the setpoint moves along a line under a limiter of its own, slower
//!   than the limits of the motors. It rests at each end for long enough that the encoder is read
//!   there.

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::motion::velocity_limit::{MotorLimits, MotorTarget, VelocityLimiter};
use crate::core::vector::{difference, interpolate, largest_difference};
use crate::model::Model;
use crate::robot::Refusal;
use crate::units::{MAX_MOTORS, MotorVec, Nanos};

/// A setpoint this near to the end of a line is at its end, counts.
const END_TOLERANCE: f64 = 1e-6;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct ConditioningCycle {
    pub client_id: u64,
    start: MotorVec,
    points: ReversalPoints,
    rounds: u32,
    dwell_ticks: u32,
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

const MAX_POINTS: usize = 2 * MAX_MOTORS;

/// Rest at every reversal point, for the motors to arrive. A position is read every 4 ms, so
/// several positions are read there.
const DWELL: Nanos = Nanos::from_millis(40);

/// Every motor moves further than the memory needs by this margin, because an encoder may stop a
/// few counts before its setpoint.
const MARGIN_COUNTS: f64 = 10.0;

/// Half-width where neither configuration nor model define one, counts: about 11 deg of bend.
const DEFAULT_HALF_WIDTH: f64 = 500.0;

/// Turns, the first with full amplitude, the others decaying.
const TURNS: u32 = 4;

/// Longer than any line between two positions of a drive, counts.
const MAX_LINE_LENGTH: f64 = 1e10;

#[derive(Debug, Clone, Copy)]
pub(crate) struct ConditioningPlan {
    motors: usize,
    lowest: MotorVec,
    highest: MotorVec,
    half_width: Option<f64>,
    pub(super) rounds: u32,
    pub(super) dwell_ticks: u32,
    /// Limiter along a line, counts.
    pub(super) limiter: VelocityLimiter,
}

/// The reversal points of a region, in the order of one round.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct ReversalPoints {
    points: [MotorVec; MAX_POINTS],
    pub count: u32,
}

impl ConditioningPlan {
    pub(crate) fn new(config: &Config) -> Self {
        let motors = config.motors().min(MAX_MOTORS);
        let (mut lowest, mut highest) = (MotorVec::default(), MotorVec::default());
        for ((motor, lowest), highest) in (0..motors).zip(&mut lowest).zip(&mut highest) {
            if let Some(axis) = config.axis(motor) {
                *lowest = axis.position_min_counts.as_f64();
                *highest = axis.position_max_counts.as_f64();
            }
        }
        let acceleration = config.limits.acceleration_counts_s2;
        let limits = MotorLimits {
            velocity: config.limits.velocity_counts_s / 2.0,
            acceleration,
            deceleration: acceleration,
            lowest: 0.0,
            highest: MAX_LINE_LENGTH,
        };
        let period = config.control.period();
        Self {
            motors,
            lowest,
            highest,
            half_width: config.compensation.conditioning_counts.map(f64::from),
            rounds: TURNS,
            dwell_ticks: u32::try_from(DWELL.0 / period.0.max(1)).unwrap_or(u32::MAX),
            limiter: VelocityLimiter::new(&limits, period),
        }
    }

    /// The reversal points of a cycle that starts at given setpoints: those of the calibrated hull,
    /// or of a cross around the start if a half-width is configured or the hull is too small.
    /// [`Refusal::Range`] if the position limits leave less room than the model needs to forget.
    fn reversal_points(
        &self,
        start: &MotorVec,
        model: Option<&Model>,
    ) -> Result<ReversalPoints, Refusal> {
        let needed = model.map_or(MotorVec::default(), Model::conditioning_range);
        let hull = model.filter(|_| self.half_width.is_none()).map(|model| self.hull(model));
        let points = hull
            .filter(|points| points.cover(&needed))
            .unwrap_or_else(|| self.cross(start, &needed));
        if points.cover(&needed) { Ok(points) } else { Err(Refusal::Range) }
    }

    /// The reversal points of the calibrated hull, clamped to the position limits.
    fn hull(&self, model: &Model) -> ReversalPoints {
        let mut points = self.all_at(model.hull().centre());
        for corner in model.hull().corners() {
            let corner = self.clamp(corner);
            for (index, point) in points.iter_mut() {
                if height(&corner, index, self.motors) > height(point, index, self.motors) {
                    *point = corner;
                }
            }
        }
        points
    }

    /// One motor after the other, to both sides of the start, or of the nearest point with enough
    /// room.
    fn cross(&self, start: &MotorVec, needed: &MotorVec) -> ReversalPoints {
        let configured = self.half_width.unwrap_or(DEFAULT_HALF_WIDTH);
        let half_widths = needed.map(|width| (width / 2.0 + MARGIN_COUNTS).max(configured));
        let mut centre = *start;
        let limits = self.lowest.iter().zip(&self.highest);
        for ((centre, half_width), (lowest, highest)) in
            centre.iter_mut().zip(half_widths).zip(limits)
        {
            let room = half_width.min((highest - lowest) / 2.0);
            *centre = centre.min(highest - room).max(lowest + room);
        }
        let mut points = self.all_at(centre);
        for (index, point) in points.iter_mut() {
            let (motor, sign) = motor_and_sign(index, self.motors);
            if let (Some(value), Some(half_width)) = (point.get_mut(motor), half_widths.get(motor))
            {
                *value += sign * half_width;
            }
            *point = self.clamp(*point);
        }
        points
    }

    fn all_at(&self, point: MotorVec) -> ReversalPoints {
        ReversalPoints { points: [self.clamp(point); MAX_POINTS], count: 2 * self.motors as u32 }
    }

    fn clamp(&self, mut counts: MotorVec) -> MotorVec {
        let limits = self.lowest.iter().zip(&self.highest);
        for (counts, (lowest, highest)) in counts.iter_mut().zip(limits) {
            *counts = counts.min(*highest).max(*lowest);
        }
        counts
    }
}

/// The motor that reverses at a point of the round, and at which end: first the highest point of
/// every motor, then the lowest.
fn motor_and_sign(index: usize, motors: usize) -> (usize, f64) {
    if index < motors { (index, 1.0) } else { (index - motors, -1.0) }
}

fn height(point: &MotorVec, index: usize, motors: usize) -> f64 {
    let (motor, sign) = motor_and_sign(index, motors);
    sign * point.get(motor).copied().unwrap_or_default()
}

impl ReversalPoints {
    /// The point with a number; numbering continues after a round.
    pub(super) fn get(&self, number: u32) -> Option<&MotorVec> {
        self.points.get((number % self.count.max(1)) as usize)
    }

    fn iter_mut(&mut self) -> impl Iterator<Item = (usize, &mut MotorVec)> {
        self.points.iter_mut().enumerate().take(self.count as usize)
    }

    /// Whether every motor covers a range of at least this many counts.
    fn cover(&self, ranges: &MotorVec) -> bool {
        let range = |motor: usize| {
            let points = self.points.iter().take(self.count as usize);
            let values = points.filter_map(|point| point.get(motor));
            let start = (f64::INFINITY, f64::NEG_INFINITY);
            let (low, high) = values.fold(start, |(l, h), v| (l.min(*v), h.max(*v)));
            high - low
        };
        let mut needed = ranges.iter().enumerate().take(self.count as usize / 2);
        needed.all(|(motor, needed)| range(motor) >= *needed)
    }
}
