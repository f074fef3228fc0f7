//! Invariants of every tick of every situation, with formulae of its own: the snake of the tests
//! with its gaps, distances to regions, angles at the setpoints, motor acceleration, command ages.
//! The bench itself checks the other motor limits, states and counters.

use i2ris::config::JointLimitConfig;

use super::*;

/// Corners of the calibrated hull, counter-clockwise. Motors limited one by one stay inside along
/// the sides of the square, but not along those of the slanted hull.
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
/// Delay of a stop in ticks, in addition to braking.
const STOP_TICKS: u32 = 6;
/// Maximum gain of a swapped-in model, compared with the first.
pub const LARGEST_GAIN: f64 = 1.3;
/// Ticks over which speed is measured, so that rounding to counts hardly matters.
const WINDOW: usize = 25;
/// The same for a motor.
const MOTOR_WINDOW: usize = 10;
/// Error of the inverse in a step, degrees.
const STEP_DEG: f64 = 5e-5;
/// A count in each motor, at both ends.
const ROUNDING_DEG: f64 = 4.0 * GAIN_DEG;

/// Braking distance from full speed, when a limit is set during motion.
#[derive(Debug, Clone, Copy)]
pub struct Stop {
    degrees: f64,
    ticks: u32,
    /// counts/s^2.
    slow_down: f64,
    speed_up: f64,
    /// Delay before braking, s.
    delay_s: f64,
}

impl Stop {
    pub fn new(config: &Config) -> Self {
        let limits = &config.limits;
        let (speed, slow_down) = (limits.velocity_counts_s, limits.stop_deceleration_counts_s2);
        let window = limits.window_ticks(config.control.period()).unwrap_or(1);
        let delay_s = 1e-3 * f64::from(window + 1);
        let seconds = speed / slow_down + delay_s + 1e-3 * f64::from(STOP_TICKS);
        let counts = speed * (0.5 * speed / slow_down + delay_s);
        Self {
            degrees: 2.0 * GAIN_DEG * LARGEST_GAIN * counts + TOLERANCE_DEG,
            ticks: (1e3 * seconds).ceil() as u32,
            slow_down,
            speed_up: limits.acceleration_counts_s2,
            delay_s,
        }
    }

    /// Braking distance from a common speed of both motors, degrees.
    fn way_deg(&self, speed_deg_s: f64) -> f64 {
        let speed = speed_deg_s / (2.0 * GAIN_DEG);
        2.0 * GAIN_DEG * speed * (0.5 * speed / self.slow_down + self.delay_s)
    }

    /// Maximum excess of a snake that moves or is already beyond a limit.
    fn beyond(&self, excess: f64) -> f64 {
        if excess > -self.degrees { excess.max(0.0) + self.degrees } else { 0.0 }
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

impl Limits {
    pub fn new(config: &JointLimitConfig) -> Self {
        let pair = |limits: &Option<Vec<f64>>| limits.as_ref().map(|both| [both[0], both[1]]);
        Self {
            low: pair(&config.position_min_deg),
            high: pair(&config.position_max_deg),
            velocity: config.velocity_deg_s,
            acceleration: config.acceleration_deg_s2,
        }
    }
}

/// The oracle of one situation.
pub struct Oracle {
    pub snake: Snake,
    pub path: SetpointPath,
    pub limits: Limits,
    /// The active regions, with the minimum distance allowed.
    zones: Vec<(Zone, f64)>,
    /// The largest excess over the joint limits allowed.
    excess: f64,
    /// Poses of the last ticks, as reported.
    reported: VecDeque<[f64; 2]>,
    /// The conditioning cycle started from rest or has rested.
    from_rest: bool,
    /// Raw poses of the last ticks; their correction may change later.
    past: VecDeque<[f64; 2]>,
    /// Setpoints of the last ticks.
    past_targets: VecDeque<[i32; 2]>,
    targets: [i32; 2],
    /// Ticks in which the robot had nothing to follow.
    idle: u32,
    /// When the followed command becomes stale.
    stale_at: Nanos,
    stop: Stop,
    pub hull: &'static [[f64; 2]],
    hull_excess: f64,
    /// The last command was in angles, not counts.
    pub in_hull: bool,
    /// Ticks until motion that may leave the hull is at rest.
    leaving: u32,
    /// Ticks since a limit was set that the snake may exceed.
    settled: u32,
}

impl Oracle {
    pub fn new(
        snake: Snake,
        limits: Limits,
        hull: &'static [[f64; 2]],
        stop: Stop,
        path: SetpointPath,
    ) -> Self {
        Self {
            path,
            snake,
            limits,
            zones: Vec::new(),
            excess: 0.0,
            reported: VecDeque::new(),
            from_rest: false,
            past: VecDeque::new(),
            past_targets: VecDeque::new(),
            targets: [0; 2],
            idle: 0,
            stale_at: Nanos::ZERO,
            stop,
            hull,
            hull_excess: 0.0,
            in_hull: true,
            leaving: 0,
            settled: 0,
        }
    }

    /// Discards the history.
    pub fn begin(&mut self, bench: &Bench) {
        self.snake.follow(bench.drives.each_ref().map(|drive| drive.feedback.position.as_f64()));
        self.targets = bench.targets();
        self.hull_excess = out_of(self.hull, self.targets.map(f64::from));
        self.reset_view(bench);
    }

    /// The snake is now seen through a different model, so it may be anywhere.
    pub fn reset_view(&mut self, bench: &Bench) {
        self.past.clear();
        self.reported.clear();
        self.from_rest = false;
        self.path.begin();
        self.settled = 0;
        let at = self.seen(bench);
        self.excess = self.stop.beyond(self.excess(adapted(bench, at)));
        for (zone, least) in &mut self.zones {
            *least = -self.stop.beyond(-zone.distance(at));
        }
    }

    /// Activates these regions. The snake leaves a region set over it and enters no deeper.
    pub fn set_zones(&mut self, bench: &Bench, zones: &[Zone]) {
        let at = self.seen(bench);
        let least = |zone: &Zone| -self.stop.beyond(-zone.distance(at));
        self.zones = zones.iter().map(|zone| (*zone, least(zone))).collect();
        self.settled = 0;
    }

    /// Whether a command is followed that will not be stale in the next tick.
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

    pub fn seen(&self, bench: &Bench) -> [f64; 2] {
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

    /// Checks the last tick.
    pub fn check(&mut self, bench: &Bench) {
        let report = bench.report();
        let targets = bench.targets();
        let is_on = matches!(report.state, OperatingState::Enabled | OperatingState::Paused);
        self.snake.follow(bench.drives.each_ref().map(|drive| drive.feedback.position.as_f64()));
        if !is_on {
            self.past.clear();
            self.past_targets.clear();
            self.targets = targets;
            self.reset_view(bench);
            return;
        }
        self.settled += 1;
        let at = self.seen(bench);
        self.check_zones(at);
        self.check_angles(bench, at);
        self.check_start(bench);
        self.check_hull(targets, report.busy);
        self.check_rest(bench, targets);
        self.check_motors(targets);
        self.path.check(bench, &self.snake, at);
        self.targets = targets;
    }

    /// Motors may slow down harder than they speed up, and turn round in between.
    fn check_motors(&mut self, targets: [i32; 2]) {
        self.past_targets.push_back(targets);
        if self.past_targets.len() <= 2 * MOTOR_WINDOW {
            return;
        }
        let [old, middle] = [0, MOTOR_WINDOW].map(|index| self.past_targets[index]);
        self.past_targets.pop_front();
        let seconds = MOTOR_WINDOW as f64 * 1e-3;
        for motor in 0..2 {
            let moved = f64::from((targets[motor] - middle[motor]).abs());
            let before = f64::from((middle[motor] - old[motor]).abs());
            let most = before + 1.5 * self.stop.speed_up * seconds * seconds + 2.0;
            assert!(moved <= most, "motor {motor}: {moved} counts after {before}");
        }
    }

    fn check_zones(&mut self, at: [f64; 2]) {
        for (zone, least) in &mut self.zones {
            let distance = zone.distance(at);
            assert!(
                distance >= *least - TOLERANCE_DEG,
                "{distance} deg from {zone:?}, and not below {least}"
            );
            if self.settled > self.stop.ticks {
                *least = least.max(distance.min(0.0));
            }
        }
    }

    fn check_angles(&mut self, bench: &Bench, seen: [f64; 2]) {
        let at = adapted(bench, seen);
        let excess = self.excess(at);
        assert!(
            excess <= self.excess + TOLERANCE_DEG,
            "{at:?} is {excess} deg beyond {:?}",
            self.limits
        );
        if self.settled > self.stop.ticks {
            self.excess = self.excess.min(excess.max(0.0));
        }
        self.past.push_back(seen);
        if self.past.len() <= 2 * WINDOW {
            return;
        }
        let [old, middle, new] =
            [0, WINDOW, 2 * WINDOW].map(|index| adapted(bench, self.past[index]));
        self.past.pop_front();
        let seconds = WINDOW as f64 * 1e-3;
        for output in 0..2 {
            let moved = (new[output] - middle[output]).abs();
            let before = (middle[output] - old[output]).abs();
            if let Some(velocity) = self.limits.velocity {
                // Where a gap ends, motors slow down that were twice as fast as they may be
                // then, or as fast as they can: where a gap is all, nothing has moved before.
                let late = match self.snake.wire {
                    Wire::Halved => self.stop.way_deg(velocity),
                    Wire::Balance => self.stop.degrees,
                    Wire::Taut | Wire::Network | Wire::Place => 0.0,
                };
                let most = 1.05 * velocity * seconds + ROUNDING_DEG + late;
                assert!(
                    moved <= most,
                    "{moved} deg in {seconds} s at {velocity} deg/s, {:?}",
                    self.snake
                );
            }
            // The controller learns where a gap ends only when the encoders show it.
            if let Some(acceleration) =
                self.limits.acceleration.filter(|_| self.snake.wire == Wire::Taut)
            {
                let most = before + 1.1 * acceleration * seconds * seconds + 2.0 * ROUNDING_DEG;
                assert!(moved <= most, "{moved} deg after {before}, {acceleration} deg/s^2");
            }
        }
    }

    /// In a conditioning cycle, where only the gate limits it, motion speeds up from rest no faster
    /// over the time of a line than the acceleration lets it: as it is reported, because counts are
    /// too coarse for that. In motion, it begins with a stop, which only the motors limit.
    fn check_start(&mut self, bench: &Bench) {
        let report = bench.report();
        let (Some(joint), Wire::Taut) = (report.joint, self.snake.wire) else { return };
        let line = bench.config.setpoint_interval().0.div_ceil(1_000_000) as usize;
        let around = 2.min(line - 1);
        self.reported.push_front(self.snake.wire.angles(joint.setpoint));
        if self.reported.len() < line + around + 2 {
            return;
        }
        self.reported.truncate(line + around + 2);
        let steps: Vec<_> = (1..self.reported.len())
            .map(|k| plus(self.reported[k - 1], self.reported[k], -1.0))
            .collect();
        let is_conditioning = report.busy && matches!(self.path.expected.what, What::Counts(_));
        let is_at_rest = steps.iter().all(|step| *step == [0.0; 2]);
        self.from_rest = is_at_rest || self.from_rest && is_conditioning;
        // A stop of motors with a jerk limit begins late, and the gate never lengthens one.
        let is_late = bench.config.limits.jerk_counts_s3.is_some();
        let is_judged = self.from_rest && report.adaptation.is_none() && !is_late;
        let Some(acceleration) = self.limits.acceleration.filter(|_| is_judged) else { return };
        for output in 0..2 {
            let step = steps[0][output];
            let along = |before: &[f64; 2]| before[output] * step.signum();
            let then = &steps[line - around..=line + around];
            let then = then.iter().map(along).sum::<f64>() / then.len() as f64;
            let most = (then + 1.01e-6 * acceleration * line as f64).max(along(&steps[1])).max(0.0);
            assert!(step.abs() <= most + STEP_DEG, "{step} deg, and not {most}: {steps:?}");
        }
    }

    /// Goals in angles are inverted within the hull; other motion and the zero may leave it.
    fn check_hull(&mut self, targets: [i32; 2], is_busy: bool) {
        let excess = out_of(self.hull, targets.map(f64::from));
        let may_leave = is_busy || !self.in_hull;
        self.leaving = if may_leave { self.stop.ticks } else { self.leaving.saturating_sub(1) };
        assert!(
            self.leaving > 0 || excess <= self.hull_excess.max(2.0),
            "{targets:?} is out of the hull by {excess}, before {}",
            self.hull_excess
        );
        self.hull_excess = excess;
    }

    /// Nothing moves without a fresh command, a trajectory or a conditioning cycle.
    fn check_rest(&mut self, bench: &Bench, targets: [i32; 2]) {
        let is_asked = bench.now < self.stale_at && !bench.report().holding || bench.report().busy;
        self.idle = if is_asked { 0 } else { self.idle + 1 };
        assert!(
            self.idle <= self.stop.ticks || targets == self.targets,
            "{:?} to {targets:?}, {} ticks after the last command",
            self.targets,
            self.idle
        );
    }
}

/// Distance of a point beyond the side that it violates most; 0 inside.
fn out_of(hull: &[[f64; 2]], [a, b]: [f64; 2]) -> f64 {
    let nexts = hull.iter().cycle().skip(1);
    let beyond = hull.iter().zip(nexts).map(|([from_a, from_b], [to_a, to_b])| {
        let (along_a, along_b) = (to_a - from_a, to_b - from_b);
        (along_b * (a - from_a) - along_a * (b - from_b)) / along_a.hypot(along_b)
    });
    beyond.fold(0.0, f64::max)
}

/// The pose with the correction that is applied: `pose + zero + gain pose`, degrees.
pub fn adapted(bench: &Bench, at: [f64; 2]) -> [f64; 2] {
    let Some(adaptation) = bench.report().adaptation else { return at };
    let (zero, gain) = (adaptation.applied.zero, adaptation.applied.gain);
    [0, 1].map(|row: usize| {
        at[row] + zero[row].to_degrees() + gain[row][0] * at[0] + gain[row][1] * at[1]
    })
}
