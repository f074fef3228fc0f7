//! The decaying stroke of the command `condition`: it wipes out what nobody knows about the past of
//! the wires.
//!
//! Friction and gaps remember the turning points of the motors, and a turning point is forgotten as
//! soon as the motor goes past it (I. D. Mayergoyz 1986, the wiping-out property). The stroke
//! therefore starts with one turn through all extremes of a region, so that nothing older survives,
//! and goes on with turns that shrink, like the demagnetisation of a magnet: what is remembered in
//! the end is small, even, and the same every time.
//!
//! - **extremes**: the lowest and the highest point of every motor in the region, in the order of a
//!   turn. The stroke goes between them on straight lines. The region is convex, so it is never
//!   left, and every motor covers its whole width.
//! - **decay**: later extremes are drawn towards the start of the stroke, evenly, down to it. The
//!   stroke ends where it began, whether that is the middle of the region or not.
//! - between two extremes the set-point moves along the line under a limiter of its own, slower
//!   than the limits of the motors, and comes to rest at each end for long enough that the encoder
//!   is read there.

use serde::{Deserialize, Serialize};

use crate::config::{ConditioningConfig, Config};
use crate::core::motion::velocity_limit::{Limiter, Limits, Target};
use crate::model::Model;
use crate::robot::Refusal;
use crate::units::{MAX_MOTORS, MotorVec, Nanos};

/// The most extremes of a region.
const MAX_EXTREMES: usize = 2 * MAX_MOTORS;

/// Rest at every extreme. The motors arrive, and a position is read every 4 ms, so several are.
const DWELL: Nanos = Nanos::from_millis(40);

/// How much further than the memory needs every motor goes: an encoder may stop a few counts short
/// of a set-point.
const MARGIN_COUNTS: f64 = 10.0;

/// Half the width of the stroke where neither configuration nor model say, counts: about 11 deg of
/// bend.
const DEFAULT_HALF_WIDTH: f64 = 500.0;

/// A set-point this near to the end of a line is at its end, counts.
const AT_END: f64 = 1e-6;

/// Longer than any line between two counts of a drive.
const LONGEST_LINE: f64 = 1e10;

/// What strokes have in common.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plan {
    motors: usize,
    lowest: MotorVec,
    highest: MotorVec,
    half_width: Option<f64>,
    turns: u32,
    dwell_ticks: u32,
    way: Limiter,
}

/// A stroke under way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Stroke {
    start: MotorVec,
    extremes: Extremes,
    turns: u32,
    dwell_ticks: u32,
    /// Number of the present line.
    line: u32,
    from: MotorVec,
    to: MotorVec,
    /// Along the line, counts of the motor that has the longer way.
    way: Limiter,
    length: f64,
    /// Ticks spent at the end of the line.
    rested: u32,
    place: MotorVec,
    moved: MotorVec,
}

/// The extremes of a region, in the order of a turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Extremes {
    points: [MotorVec; MAX_EXTREMES],
    count: u32,
}

impl Plan {
    /// As configured. The configuration has been checked before.
    pub fn new(config: &Config) -> Self {
        let ConditioningConfig {
            half_width_counts,
            turns,
            velocity_counts_s,
        } = config.conditioning;
        let motors = config.motors().min(MAX_MOTORS);
        let (mut lowest, mut highest) = (MotorVec::default(), MotorVec::default());
        for ((motor, lowest), highest) in (0..motors).zip(&mut lowest).zip(&mut highest) {
            let limits = config
                .axis(motor)
                .map(|axis| (axis.position_min_counts, axis.position_max_counts));
            (*lowest, *highest) =
                limits.map_or((0.0, 0.0), |(low, high)| (low.as_f64(), high.as_f64()));
        }
        let acceleration = config.limits.acceleration_counts_s2;
        let limits = Limits {
            velocity: velocity_counts_s.min(config.limits.velocity_counts_s),
            acceleration,
            deceleration: acceleration,
            lowest: 0.0,
            highest: LONGEST_LINE,
        };
        let period = config.control.period();
        Self {
            motors,
            lowest,
            highest,
            half_width: half_width_counts.map(f64::from),
            turns,
            dwell_ticks: u32::try_from(DWELL.0 / period.0.max(1)).unwrap_or(u32::MAX),
            way: Limiter::new(&limits, period),
        }
    }

    /// A stroke that begins at given set-points.
    ///
    /// # Errors
    ///
    /// [`Refusal::Range`] when the position limits leave less room than the model needs to forget.
    pub fn begin(&self, start: MotorVec, model: Option<&Model>) -> Result<Stroke, Refusal> {
        let needed = model.map_or(MotorVec::default(), Model::wipe_counts);
        let hull = model
            .filter(|_| self.half_width.is_none())
            .map(|model| self.hull(model));
        let extremes = hull
            .filter(|extremes| extremes.cover(&needed))
            .unwrap_or_else(|| self.cross(&start, &needed));
        if !extremes.cover(&needed) {
            return Err(Refusal::Range);
        }
        Ok(Stroke {
            start,
            extremes,
            turns: self.turns,
            dwell_ticks: self.dwell_ticks,
            line: 0,
            from: start,
            to: start,
            way: self.way,
            length: 0.0,
            rested: 0,
            place: start,
            moved: MotorVec::default(),
        }
        .on_line(0))
    }

    /// The extremes of the calibrated hull, cut to the position limits.
    fn hull(&self, model: &Model) -> Extremes {
        let mut extremes = self.around(model.hull().centre());
        for corner in model.hull().corners() {
            let corner = self.cut(corner);
            extremes
                .points
                .iter_mut()
                .enumerate()
                .take(extremes.count as usize)
                .for_each(|(place, point)| {
                    if height(&corner, place, self.motors) > height(point, place, self.motors) {
                        *point = corner;
                    }
                });
        }
        extremes
    }

    /// One motor after the other, to both sides of the start, or of the nearest point with enough
    /// room.
    fn cross(&self, start: &MotorVec, needed: &MotorVec) -> Extremes {
        let mut half_widths = *needed;
        for half_width in &mut half_widths {
            *half_width = (*half_width / 2.0 + MARGIN_COUNTS)
                .max(self.half_width.unwrap_or(DEFAULT_HALF_WIDTH));
        }
        let mut middle = *start;
        let limits = self.lowest.iter().zip(&self.highest);
        for ((middle, half_width), (lowest, highest)) in
            middle.iter_mut().zip(half_widths).zip(limits)
        {
            let room = half_width.min((highest - lowest) / 2.0);
            *middle = middle.min(highest - room).max(lowest + room);
        }
        let mut extremes = self.around(middle);
        for (place, point) in extremes
            .points
            .iter_mut()
            .enumerate()
            .take(extremes.count as usize)
        {
            let (motor, sign) = side(place, self.motors);
            for ((value, half_width), _) in point.iter_mut().zip(half_widths).skip(motor).zip(0..1)
            {
                *value += sign * half_width;
            }
            *point = self.cut(*point);
        }
        extremes
    }

    fn around(&self, point: MotorVec) -> Extremes {
        Extremes {
            points: [self.cut(point); MAX_EXTREMES],
            count: 2 * self.motors as u32,
        }
    }

    fn cut(&self, mut counts: MotorVec) -> MotorVec {
        let limits = self.lowest.iter().zip(&self.highest);
        counts
            .iter_mut()
            .zip(limits)
            .for_each(|(counts, (low, high))| *counts = counts.min(*high).max(*low));
        counts
    }
}

/// Which motor is at its end at a place of the turn, and at which: first all highest, then all
/// lowest.
fn side(place: usize, motors: usize) -> (usize, f64) {
    if place < motors {
        (place, 1.0)
    } else {
        (place - motors, -1.0)
    }
}

fn height(point: &MotorVec, place: usize, motors: usize) -> f64 {
    let (motor, sign) = side(place, motors);
    sign * point.get(motor).copied().unwrap_or_default()
}

impl Extremes {
    /// Every motor goes over a range of at least so many counts.
    fn cover(&self, ranges: &MotorVec) -> bool {
        let points = || self.points.iter().take(self.count as usize);
        ranges
            .iter()
            .enumerate()
            .take(self.count as usize / 2)
            .all(|(motor, range)| {
                let values = || points().filter_map(|point| point.get(motor));
                let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                    (l.min(*v), h.max(*v))
                });
                high - low >= *range
            })
    }
}

impl Stroke {
    /// One tick later; `None` once it has ended where it began.
    pub fn after_tick(mut self) -> Option<Self> {
        let arrived = self.way.at_rest() && (self.length - self.way.position()).abs() < AT_END;
        if arrived && self.rested >= self.dwell_ticks {
            return (self.line < self.last_line()).then(|| self.on_line(self.line + 1));
        }
        self.rested = if arrived { self.rested + 1 } else { 0 };
        self.way.follow(Target::fixed(self.length));
        let before = self.place;
        let share = if self.length > 0.0 {
            (self.way.position() / self.length).min(1.0)
        } else {
            1.0
        };
        self.place = between(&self.from, &self.to, share);
        self.moved = self.place;
        self.moved
            .iter_mut()
            .zip(before)
            .for_each(|(moved, before)| *moved -= before);
        Some(self)
    }

    /// Where the motors should be in this tick.
    pub fn targets(&self) -> [Target; MAX_MOTORS] {
        let mut targets = [Target::default(); MAX_MOTORS];
        for ((target, position), moved) in targets.iter_mut().zip(self.place).zip(self.moved) {
            *target = Target { position, moved };
        }
        targets
    }

    /// The same as counts.
    pub fn place(&self) -> &MotorVec {
        &self.place
    }

    /// The line that leads back to the start.
    fn last_line(&self) -> u32 {
        self.turns.saturating_mul(self.extremes.count)
    }

    /// At the beginning of a line.
    fn on_line(mut self, line: u32) -> Self {
        (self.line, self.rested) = (line, 0);
        self.from = self.place;
        self.to = self.end_of(line);
        self.moved = MotorVec::default();
        self.length = self
            .from
            .iter()
            .zip(&self.to)
            .map(|(from, to)| (to - from).abs())
            .fold(0.0, f64::max);
        self.way.restart(0.0);
        self
    }

    /// The first turn goes to the extremes themselves, the others draw them towards the start, the
    /// last line leads there.
    fn end_of(&self, line: u32) -> MotorVec {
        let (count, last) = (self.extremes.count.max(1), self.last_line());
        let decayed = (line + 1).saturating_sub(count);
        let share =
            1.0 - f64::from(decayed) / f64::from(last.saturating_sub(count).saturating_add(1));
        let extreme = self
            .extremes
            .points
            .get((line % count) as usize)
            .copied()
            .unwrap_or(self.start);
        if line >= last {
            self.start
        } else {
            between(&self.start, &extreme, share)
        }
    }
}

fn between(from: &MotorVec, to: &MotorVec, share: f64) -> MotorVec {
    let mut point = *from;
    point.iter_mut().zip(to).for_each(|(value, to)| {
        *value = if share >= 1.0 {
            *to
        } else {
            *value + share * (to - *value)
        }
    });
    point
}
