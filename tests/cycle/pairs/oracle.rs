//! What must hold in every tick of every situation, by formulae of its own: the snake of the tests
//! with its gaps, distances to regions, angles at the setpoints, ages of commands. The limits of the
//! motors, the states and the counters are checked by the bench itself.

use std::collections::VecDeque;

use i2ris::ipc::OperatingState;
use i2ris::units::Nanos;
use i2ris_testing::cycle::{Bench, GAIN_DEG, HULL};

/// Corners of what was calibrated, counter-clockwise. Along the sides of the square, motors that are
/// limited one by one stay inside; along those of the other one they do not.
pub const SQUARE: [[f64; 2]; 4] = [[-HULL, -HULL], [HULL, -HULL], [HULL, HULL], [-HULL, HULL]];
pub const SLANTED: [[f64; 2]; 6] = [
    [-420.0, -120.0],
    [-60.0, -420.0],
    [420.0, -300.0],
    [360.0, 180.0],
    [60.0, 480.0],
    [-360.0, 300.0],
];

/// Rounding to counts, and a stop: degrees.
const TOLERANCE_DEG: f64 = 0.08;
/// The way to rest of a motion at full speed, when a region comes over it: degrees and ticks.
const STOP_DEG: f64 = 1.5;
const STOP_TICKS: u32 = 60;
/// Ticks over which speed is measured: rounding to counts is little of it.
const WINDOW: usize = 25;
/// A count in each motor, at both ends.
const ROUNDING_DEG: f64 = 4.0 * GAIN_DEG;

/// A region in angles, degrees.
#[derive(Debug, Clone, Copy)]
pub enum Zone {
    Circle { centre: [f64; 2], radius: f64 },
    Wall { normal: [f64; 2], offset: f64 },
}

impl Zone {
    /// Positive outside.
    pub fn distance(&self, [pitch, yaw]: [f64; 2]) -> f64 {
        match self {
            Self::Circle { centre, radius } => (pitch - centre[0]).hypot(yaw - centre[1]) - radius,
            Self::Wall { normal, offset } => offset - normal[0] * pitch - normal[1] * yaw,
        }
    }
}

/// The limits of a situation, degrees.
#[derive(Debug, Clone, Copy, Default)]
pub struct Limits {
    pub low: Option<[f64; 2]>,
    pub high: Option<[f64; 2]>,
    pub velocity: Option<f64>,
    pub acceleration: Option<f64>,
}

/// The snake: every motor turns half of the wire at once, and half behind a gap.
#[derive(Debug, Clone, Copy)]
pub struct Snake {
    pub gap: f64,
    pub gain: f64,
    play: [f64; 2],
}

impl Snake {
    pub fn new(gap: f64) -> Self {
        Self { gap, gain: GAIN_DEG, play: [0.0; 2] }
    }

    fn moved(&self, counts: [f64; 2]) -> [f64; 2] {
        let follow = |motor: usize| {
            self.play[motor].max(counts[motor] - self.gap).min(counts[motor] + self.gap)
        };
        [follow(0), follow(1)]
    }

    pub fn pose(&self, counts: [f64; 2]) -> [f64; 2] {
        let play = self.moved(counts);
        let [a, b] = [0, 1].map(|motor: usize| 0.5 * (counts[motor] + play[motor]));
        [self.gain * (a + b), self.gain * (b - a)]
    }

    fn follow(&mut self, counts: [f64; 2]) {
        self.play = self.moved(counts);
    }
}

/// The oracle of one situation.
pub struct Oracle {
    pub snake: Snake,
    pub limits: Limits,
    /// The regions that count, with the least distance that is allowed.
    zones: Vec<(Zone, f64)>,
    /// The largest excess over the joint limits that is allowed.
    excess: f64,
    /// Poses of the last ticks.
    past: VecDeque<[f64; 2]>,
    targets: [i32; 2],
    /// Ticks in which the robot had nothing to follow.
    idle: u32,
    /// When the followed command becomes stale.
    stale_at: Nanos,
    stop_ticks: u32,
    hull: &'static [[f64; 2]],
    hull_excess: f64,
    /// Angles were commanded last, and not counts.
    pub in_hull: bool,
    /// Ticks since a limit came that the snake may be beyond.
    settled: u32,
}

impl Oracle {
    pub fn new(snake: Snake, limits: Limits, hull: &'static [[f64; 2]], stop_ticks: u32) -> Self {
        Self {
            snake,
            limits,
            zones: Vec::new(),
            excess: 0.0,
            past: VecDeque::new(),
            targets: [0; 2],
            idle: 0,
            stale_at: Nanos::ZERO,
            stop_ticks,
            hull,
            hull_excess: 0.0,
            in_hull: true,
            settled: 0,
        }
    }

    /// From now on the snake is seen with another model: it may be anywhere.
    pub fn see_anew(&mut self, bench: &Bench) {
        self.past.clear();
        self.settled = 0;
        let at = self.seen(bench);
        self.excess = beyond(self.excess(adapted(bench, at)));
        for (zone, least) in &mut self.zones {
            *least = -beyond(-zone.distance(at));
        }
    }

    /// These regions count from now on. One that comes over the snake is left, not entered deeper.
    pub fn set_zones(&mut self, bench: &Bench, zones: &[Zone]) {
        let at = self.seen(bench);
        let least = |zone: &Zone| -beyond(-zone.distance(at));
        self.zones = zones.iter().map(|zone| (*zone, least(zone))).collect();
        self.settled = 0;
    }

    /// A command is followed that is not stale in the next tick.
    pub fn is_followed(&self, bench: &Bench) -> bool {
        let report = bench.report();
        bench.now + bench.config.control.period() < self.stale_at
            && !report.holding
            && !report.busy
            && report.state == OperatingState::Enabled
    }

    /// A command was accepted.
    pub fn accepted(&mut self, stamp: Nanos, deadline: Nanos) {
        self.stale_at = stamp + deadline;
    }

    fn seen(&self, bench: &Bench) -> [f64; 2] {
        self.snake.pose(bench.targets().map(f64::from))
    }

    fn excess(&self, at: [f64; 2]) -> f64 {
        let beyond = |output: usize| {
            let low = self.limits.low.map_or(f64::MIN, |low| low[output] - at[output]);
            let high = self.limits.high.map_or(f64::MIN, |high| at[output] - high[output]);
            low.max(high)
        };
        beyond(0).max(beyond(1))
    }

    /// Checks the tick that has just been.
    pub fn check(&mut self, bench: &Bench) {
        let report = bench.report();
        let targets = bench.targets();
        let is_on = matches!(report.state, OperatingState::Enabled | OperatingState::Paused);
        let positions = bench.drives.each_ref().map(|drive| drive.feedback.position.as_f64());
        self.snake.follow(positions);
        if !is_on {
            self.past.clear();
            self.targets = targets;
            self.see_anew(bench);
            return;
        }
        self.settled += 1;
        let at = self.seen(bench);
        self.check_zones(at);
        self.check_angles(adapted(bench, at));
        self.check_hull(targets, report.busy);
        self.check_rest(bench, targets);
        self.targets = targets;
    }

    fn check_zones(&mut self, at: [f64; 2]) {
        for (zone, least) in &mut self.zones {
            let distance = zone.distance(at);
            assert!(
                distance >= *least - TOLERANCE_DEG,
                "{distance} deg from {zone:?}, and not below {least}"
            );
            if self.settled > STOP_TICKS {
                *least = least.max(distance.min(0.0));
            }
        }
    }

    fn check_angles(&mut self, at: [f64; 2]) {
        let excess = self.excess(at);
        assert!(
            excess <= self.excess + TOLERANCE_DEG,
            "{at:?} is {excess} deg beyond {:?}",
            self.limits
        );
        if self.settled > STOP_TICKS {
            self.excess = self.excess.min(excess.max(0.0));
        }
        self.past.push_back(at);
        if self.past.len() <= 2 * WINDOW {
            return;
        }
        let [old, middle, new] = [0, WINDOW, 2 * WINDOW].map(|index| self.past[index]);
        self.past.pop_front();
        let seconds = WINDOW as f64 * 1e-3;
        for output in 0..2 {
            let moved = (new[output] - middle[output]).abs();
            let before = (middle[output] - old[output]).abs();
            if let Some(velocity) = self.limits.velocity {
                let most = 1.05 * velocity * seconds + ROUNDING_DEG;
                assert!(moved <= most, "{moved} deg in {seconds} s at {velocity} deg/s");
            }
            // Behind a gap, the controller learns where the gap ends when the encoders show it.
            if let Some(acceleration) = self.limits.acceleration.filter(|_| self.snake.gap == 0.0) {
                let most = before + 1.1 * acceleration * seconds * seconds + 2.0 * ROUNDING_DEG;
                assert!(moved <= most, "{moved} deg after {before}, {acceleration} deg/s^2");
            }
        }
    }

    /// Goals in angles are inverted within the hull; other motion and the zero may leave it.
    fn check_hull(&mut self, targets: [i32; 2], is_busy: bool) {
        let excess = out_of(self.hull, targets.map(f64::from));
        assert!(
            is_busy || !self.in_hull || excess <= self.hull_excess.max(2.0),
            "{targets:?} is out of the hull"
        );
        self.hull_excess = excess;
    }

    /// Nothing moves without a fresh command, a trajectory or a conditioning cycle.
    fn check_rest(&mut self, bench: &Bench, targets: [i32; 2]) {
        let is_asked = bench.now < self.stale_at && !bench.report().holding || bench.report().busy;
        self.idle = if is_asked { 0 } else { self.idle + 1 };
        assert!(
            self.idle <= self.stop_ticks || targets == self.targets,
            "{:?} to {targets:?}, {} ticks after the last command",
            self.targets,
            self.idle
        );
    }
}

/// How far a point is beyond the side that it violates most; 0 inside.
fn out_of(hull: &[[f64; 2]], [a, b]: [f64; 2]) -> f64 {
    let nexts = hull.iter().cycle().skip(1);
    let beyond = hull.iter().zip(nexts).map(|([from_a, from_b], [to_a, to_b])| {
        let (along_a, along_b) = (to_a - from_a, to_b - from_b);
        (along_b * (a - from_a) - along_a * (b - from_b)) / along_a.hypot(along_b)
    });
    beyond.fold(0.0, f64::max)
}

/// How far beyond a limit the snake may get that is beyond it already, or moves.
fn beyond(excess: f64) -> f64 {
    if excess > -STOP_DEG { excess.max(0.0) + STOP_DEG } else { 0.0 }
}

/// The pose with the correction that is applied: `pose + zero + gain pose`, degrees.
fn adapted(bench: &Bench, at: [f64; 2]) -> [f64; 2] {
    let Some(adaptation) = bench.report().adaptation else { return at };
    let (zero, gain) = (adaptation.applied.zero, adaptation.applied.gain);
    [0, 1].map(|row: usize| {
        at[row] + zero[row].to_degrees() + gain[row][0] * at[0] + gain[row][1] * at[1]
    })
}
