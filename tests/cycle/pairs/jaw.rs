//! The auxiliary axis in the pairs: its stream runs in parallel with that of the joints, under the
//! same lease, and whatever holds the robot holds this axis.

use i2ris::config::LimitConfig;

use super::*;

/// Ticks over which its acceleration is measured.
const WINDOW: usize = 10;
/// Ticks over which its path is checked.
const PATH_WINDOW: usize = 400;
/// Extrapolation of a goal between commands.
const AHEAD_S: f64 = 0.02;
/// Scale of [`with_jaw`].
const COUNTS_PER_DEG: f64 = -10.0;

/// Expected goal and observed motion of the jaw.
pub(super) struct Jaw {
    random: Random,
    goal_deg: f64,
    rate_deg_s: f64,
    /// When the followed command becomes stale; zero if no command is followed.
    stale_at: Nanos,
    past: VecDeque<i32>,
    /// Actual and expected positions of the last ticks, counts.
    goals: VecDeque<[f64; 2]>,
    expected: Option<f64>,
    idle: u32,
}

impl Jaw {
    /// Draws a jaw in every second situation, with its own generator: other draws stay the same.
    pub fn draw(seed: u64, config: Config) -> (Option<Self>, Config) {
        if seed.is_multiple_of(2) {
            return (None, config);
        }
        let jaw = Self {
            random: Random::new(seed ^ 0xD1B5_4A32),
            goal_deg: 0.0,
            rate_deg_s: 0.0,
            stale_at: Nanos::ZERO,
            past: VecDeque::new(),
            goals: VecDeque::new(),
            expected: None,
            idle: 0,
        };
        (Some(jaw), with_jaw(config))
    }

    /// A stop command was carried out.
    pub fn stopped(&mut self) {
        self.stale_at = Nanos::ZERO;
    }

    /// Discards the history.
    pub fn begin(&mut self) {
        (self.idle, self.stale_at) = (0, Nanos::ZERO);
        self.past.clear();
        self.goals.clear();
    }

    fn command(&mut self, bench: &mut Bench) -> Option<ServoCommand> {
        if self.random.one_in(80) {
            self.rate_deg_s = self.random.within(-60.0, 60.0);
        }
        if self.random.one_in(150) {
            self.goal_deg = self.random.within(-60.0, 60.0);
        }
        if self.random.one_in(40) || self.stale_at == Nanos::ZERO && self.random.one_in(4) {
            self.goal_deg = f64::from(target(bench)) / COUNTS_PER_DEG;
        }
        self.goal_deg += 4e-3 * self.rate_deg_s;
        let goal = ServoGoal::Joint([self.goal_deg.to_radians(), 0.0, 0.0], 1);
        let client_id = if self.random.one_in(200) { OTHER } else { CLIENT };
        let is_sent = !self.random.one_in(10);
        is_sent.then(|| ServoCommand { client_id, ..bench.servo(goal) })
    }

    /// Checks the last tick.
    pub fn check(&mut self, bench: &Bench) {
        let (report, now) = (bench.report(), target(bench));
        if !matches!(report.state, OperatingState::Enabled | OperatingState::Paused) {
            return self.begin();
        }
        let axis = bench.config.axis(2).unwrap();
        let [low, high] = [axis.position_min_counts.0, axis.position_max_counts.0];
        assert!((low..=high).contains(&now), "jaw at {now}, {low} to {high}");
        let limits = &bench.config.limits;
        let window_s = 1e-3 * WINDOW as f64;
        if let Some(before) = self.past.back() {
            let moved = f64::from((now - before).abs());
            assert!(moved <= 1e-3 * limits.velocity_counts_s + 1.0, "jaw: {before} to {now}");
            self.idle = if bench.now < self.stale_at { 0 } else { self.idle + 1 };
            let is_at_rest = self.idle > self.stop_ticks(bench);
            assert!(!is_at_rest || now == *before, "jaw: {before} to {now} without a goal");
        }
        self.check_path(limits, f64::from(now), bench.now < self.stale_at);
        self.past.push_back(now);
        if self.past.len() > 2 * WINDOW {
            let [old, middle] = [0, WINDOW].map(|index| self.past[index]);
            self.past.pop_front();
            let (moved, before) = ((now - middle).abs(), (middle - old).abs());
            let most =
                f64::from(before) + 1.5 * limits.acceleration_counts_s2 * window_s * window_s + 2.0;
            assert!(f64::from(moved) <= most, "jaw: {moved} counts after {before}");
        }
    }

    /// It stays between its actual and expected positions, plus the braking distance.
    fn check_path(&mut self, limits: &LimitConfig, now: f64, is_asked: bool) {
        let goal = self.expected.filter(|_| is_asked).unwrap_or(now);
        self.goals.push_back([now, goal]);
        if self.goals.len() > PATH_WINDOW {
            self.goals.pop_front();
        }
        let (speed, slow_down) = (limits.velocity_counts_s, limits.acceleration_counts_s2);
        let over = 0.5 * speed * speed / slow_down + AHEAD_S * speed + 4.0;
        let from = self.goals[0][0];
        let low = self.goals.iter().fold(from, |low, [_, goal]| low.min(*goal));
        let high = self.goals.iter().fold(from, |high, [_, goal]| high.max(*goal));
        assert!((low - over..=high + over).contains(&now), "jaw: {now}, {low} to {high}");
    }

    fn stop_ticks(&self, bench: &Bench) -> u32 {
        let limits = &bench.config.limits;
        let window = limits.window_ticks(bench.config.control.period()).unwrap_or(1);
        let braking_s = limits.velocity_counts_s / limits.stop_deceleration_counts_s2;
        (1e3 * braking_s).ceil() as u32 + window + 8
    }
}

fn target(bench: &Bench) -> i32 {
    bench.out.auxiliary.unwrap().target.0
}

impl Situation {
    /// Runs one tick without a joint command, possibly with a jaw command.
    pub(super) fn tick(&mut self) {
        let Some(jaw) = self.jaw.as_mut().filter(|_| self.quiet == 0) else {
            self.bench.tick();
            return self.check();
        };
        let (followed, before) = (jaw.stale_at, target(&self.bench));
        if let Some(command) = jaw.command(&mut self.bench) {
            let refusal = self.bench.send_jaw(command);
            self.judge(&command, refusal);
            if refusal == Refusal::None {
                let (ServoGoal::Joint([angle, ..], _), config) = (command.goal, &self.bench.config)
                else {
                    unreachable!("the jaw takes angles only");
                };
                let step = (angle.to_degrees() * COUNTS_PER_DEG - f64::from(before)).abs();
                let is_first = followed == Nanos::ZERO;
                let first = first_step_counts(&config.command) + 1.0;
                assert!(!is_first || step <= first, "the jaw begins {step} counts away");
                let deadline = Nanos::from_millis(config.command.deadline_ms);
                if let Some(jaw) = &mut self.jaw {
                    jaw.stale_at = command.stamp + deadline;
                    jaw.expected = Some(angle.to_degrees() * COUNTS_PER_DEG);
                }
            }
        } else {
            self.bench.tick();
        }
        self.check();
    }
}
