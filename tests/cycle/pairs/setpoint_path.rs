//! The setpoint path: the setpoint always lies between where it was and where it was expected to
//! go. No stage may lead it further: no correction, and no blend of a swap, which ends there.

use super::*;

/// Ticks that are checked together; a tremor filter has nearly reached its goal after these.
const WINDOW: usize = 300;
/// Interval of the check, ticks.
const EVERY: usize = 8;
/// Rounding to counts, dead-bands and error of the inverse, degrees.
const TOLERANCE_DEG: f64 = 0.3;
/// Ticks over which speed is measured.
const SPEED: usize = 10;
/// Detour around a circle.
const AROUND_DEG: f64 = 3.0;

/// Pitch, yaw, and the same along the motors: angles or motors do not arrive at the same time.
type Views = [f64; 4];

fn views([pitch, yaw]: Angles) -> Views {
    [pitch, yaw, 0.5 * (pitch - yaw), 0.5 * (pitch + yaw)]
}

/// Setpoint and expected goals of a tick.
struct Entry {
    seen: Angles,
    /// Bounds of the goals.
    low: Views,
    high: Views,
    /// Motion requested by a rate in this tick, downwards and upwards.
    by_rate: [Views; 2],
    /// Maximum distance of a rate's goal from the setpoint.
    ahead: f64,
    around: f64,
}

pub struct SetpointPath {
    pub expected: Expected,
    past: VecDeque<Entry>,
    /// Difference between the models at the last swap, and the end of its blend.
    blend: (f64, Nanos),
    /// deg/s^2.
    braking: f64,
    ticks: usize,
}

impl SetpointPath {
    pub fn new(expected: Expected, braking: f64) -> Self {
        Self { expected, past: VecDeque::new(), blend: (0.0, Nanos::ZERO), braking, ticks: 0 }
    }

    /// Discards the history.
    pub fn begin(&mut self) {
        self.past.clear();
    }

    /// Records a swap, and by how much the new model sees the snake elsewhere.
    pub fn swapped(&mut self, by: f64, until: Nanos) {
        self.blend = (by, until);
        self.past.clear();
    }

    /// Records the last tick and checks the last ones.
    pub fn check(&mut self, bench: &Bench, snake: &Snake, seen: Angles) {
        let report = bench.report();
        if report.holding || report.state != OperatingState::Enabled {
            self.expected.what = What::Nothing;
        }
        self.note(bench, snake, seen);
        self.ticks += 1;
        if self.ticks.is_multiple_of(EVERY) && self.past.len() > SPEED {
            self.look(bench);
        }
        if self.past.len() > WINDOW {
            self.past.pop_front();
        }
    }

    fn note(&mut self, bench: &Bench, snake: &Snake, seen: Angles) {
        let before = self.past.back().map_or(seen, |entry| entry.seen);
        let from = adapted(bench, before);
        let mut points = vec![from];
        points.extend(self.expected.goals(bench.now, from).into_iter().flatten());
        if let What::Counts([low, high]) = self.expected.what {
            let corners = [low, [low[0], high[1]], [high[0], low[1]], high];
            points.extend(corners.map(|corner| adapted(bench, snake.pose(corner))));
        }
        let (mut low, mut high) = ([f64::MAX; 4], [f64::MIN; 4]);
        for point in points.into_iter().skip(1).map(views) {
            low = [0, 1, 2, 3].map(|view: usize| low[view].min(point[view]));
            high = [0, 1, 2, 3].map(|view: usize| high[view].max(point[view]));
        }
        let (rate, ahead) = self.expected.rate(bench.now).unwrap_or_default();
        let by_rate = views(rate).map(|rate| 1e-3 * rate);
        let is_blending = bench.now < self.blend.1;
        let is_around = bench.report().limited_by_fixture.is_some();
        self.past.push_back(Entry {
            seen,
            low,
            high,
            by_rate: [by_rate.map(|rate| rate.min(0.0)), by_rate.map(|rate| rate.max(0.0))],
            ahead: if ahead > 0.0 && is_blending { ahead + self.blend.0 } else { ahead },
            around: if is_around { AROUND_DEG } else { 0.0 },
        });
    }

    fn look(&self, bench: &Bench) {
        let seen = |entry: &Entry| views(adapted(bench, entry.seen));
        let (first, last) = (seen(&self.past[0]), seen(&self.past[self.past.len() - 1]));
        let (mut low, mut high) = (first, first);
        let (mut down, mut up) = ([0.0; 4], [0.0; 4]);
        let (mut ahead, mut around) = (0.0_f64, 0.0_f64);
        for entry in &self.past {
            for view in 0..4 {
                low[view] = low[view].min(entry.low[view]);
                high[view] = high[view].max(entry.high[view]);
                down[view] += entry.by_rate[0][view];
                up[view] += entry.by_rate[1][view];
            }
            (ahead, around) = (ahead.max(entry.ahead), around.max(entry.around));
        }
        let excess = |view: usize| {
            let (low, high) = (low[view] + down[view] - ahead, high[view] + up[view] + ahead);
            (low - last[view]).max(last[view] - high).max(0.0)
        };
        let excess = excess(0).max(excess(1)).min(excess(2).max(excess(3)));
        let most = TOLERANCE_DEG + around + self.overshoot();
        assert!(
            excess <= most,
            "{excess} deg beyond what was expected, {most}: {last:?}, {low:?} to {high:?}, \
             {down:?} {up:?} {ahead}, {:?}",
            self.expected.what
        );
    }

    /// Distance that motion without a goal still needs to stop.
    fn overshoot(&self) -> f64 {
        let pairs = self.past.iter().zip(self.past.iter().skip(SPEED)).step_by(SPEED);
        let ways = pairs.map(|(from, to)| plus(to.seen, from.seen, -1.0));
        let speeds = ways.map(|[pitch, yaw]| pitch.hypot(yaw) / (1e-3 * SPEED as f64));
        let fastest = speeds.fold(0.0, f64::max);
        // A move that is replaced by another comes to rest more slowly.
        let slow_s = if let What::Pose(_) = self.expected.what { 0.12 } else { 0.02 };
        0.5 * fastest * fastest / self.braking + slow_s * fastest
    }
}
