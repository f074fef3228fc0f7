//! Any camera signal at all moves the tip by no more than the budget and no faster than the limit.
//!
//! A robot with adaptation and one without follow the same goals, both on the same plant. The
//! difference between their setpoints is the correction.

use std::iter;

use super::hazards::shift;
use super::*;

/// Kinds of signals.
const KINDS: u64 = 12;

/// A wrong camera.
struct Signal {
    kind: u64,
    random: Random,
    offset: [f64; 2],
    frozen: [f64; 2],
    interval_ms: u64,
}

impl Signal {
    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let interval_ms = match seed % 5 {
            0 => 1,
            1 => 1000,
            _ => 33,
        };
        Self {
            kind: seed / 5 % KINDS,
            offset: [random.within(-6.0, 6.0), random.within(-6.0, 6.0)],
            frozen: [random.within(-12.0, 12.0), random.within(-12.0, 12.0)],
            random,
            interval_ms,
        }
    }

    fn frame(&mut self, tick: u64, now: Nanos, truth: [f64; 2]) -> Option<ExternalPose> {
        if !tick.is_multiple_of(self.interval_ms) {
            return None;
        }
        let ms = Nanos::from_millis;
        let [pitch, yaw] = truth;
        let [a, b] = self.offset;
        let t = now.as_seconds();
        let (angles, stamp) = match self.kind {
            0 => ([self.random.within(-40.0, 40.0), self.random.within(-40.0, 40.0)], now),
            1 => (self.frozen, now),
            2 => ([-pitch, yaw], now - ms(30)),
            3 => ([yaw, pitch], now - ms(30)),
            4 => ([pitch + a, yaw + b], now - ms(40)),
            5 => ([pitch, yaw], now + ms(700)),
            6 => ([pitch, yaw], now - ms(self.random.below(500))),
            7 => ([pitch + a * (0.3 * t).sin(), yaw + b * (0.2 * t).sin()], now - ms(30)),
            8 => ([pitch * (1.0 + 0.1 * a), yaw * (1.0 + 0.1 * b)], now - ms(30)),
            9 => {
                let far = self.random.unit() < 0.3;
                let off = if far { self.random.within(-20.0, 20.0) } else { 0.0 };
                ([pitch + off, yaw - off], now - ms(30))
            }
            10 => ([pitch + 0.05 * a * t, yaw + 0.05 * b * t], now - ms(30)),
            _ => ([f64::NAN, 1e300], now),
        };
        Some(camera_frame(stamp, [angles[0].to_radians(), angles[1].to_radians(), 0.0]))
    }
}

const TABLE: &str = "[adaptation]\nenabled = true\n[limits]\nplausibility_deg = 0.0";

/// Largest correction (deg), and its largest rate beyond the share that the gain adds to the
/// motion of the goal (deg/s).
fn run(seed: u64, seconds: u64, start: &AgeingRun, model: &Arc<Model>) -> (f64, f64) {
    let mut on = start.branch(TABLE, model);
    on.seed(seed);
    let mut signal = Signal::new(seed);
    let (mut largest, mut fastest) = (0.0_f64, 0.0_f64);
    let mut before = on.adaptation().applied;
    let mut still = 0;
    for tick in 0..seconds * 1000 {
        on.frame = signal.frame(tick, on.control.now(), on.angles_deg());
        // An occasional rest.
        still = if tick % 4000 < 500 { still + 1 } else { 0 };
        let goal_before = on.goal();
        if still == 0 {
            on.time_s += 1e-3;
        }
        let goal = on.goal();
        let joint = on.report().joint.unwrap();
        let setpoint = [0, 1].map(|i: usize| joint.setpoint[i].to_degrees());
        on.follow(goal);
        let applied = on.adaptation().applied;
        // The correction, and the speed at which it moves the pose that the limit applies to.
        let now = shift(&applied, goal);
        let [from, to] = [shift(&before, setpoint), shift(&applied, setpoint)];
        let rate = (to[0] - from[0]).hypot(to[1] - from[1]) / 1e-3;
        if still > 1 {
            assert_eq!(goal, goal_before);
        }
        // The lead of the goal (`compensation.lead_ms`) ends shortly after the goal.
        if still > 100 {
            assert_eq!(applied, before, "seed {seed}: moved at rest");
        }
        largest = largest.max(now[0].hypot(now[1]));
        fastest = fastest.max(rate);
        before = applied;
    }
    (largest, fastest)
}

fn campaign(seeds: impl Iterator<Item = u64>, seconds: u64) {
    let model = first_model();
    let start = AgeingRun::blind(TABLE, SNAKES[0], &model, &[]);
    let (mut count, mut largest, mut fastest) = (0, 0.0_f64, 0.0_f64);
    for seed in seeds {
        let (shift, rate) = run(seed, seconds, &start, &model);
        assert!(shift <= 4.8 + 1e-6, "seed {seed}: {shift} deg");
        assert!(rate <= 1.0 + 1e-6, "seed {seed}: {rate} deg/s");
        count += 1;
        largest = largest.max(shift);
        fastest = fastest.max(rate);
    }
    println!("{count} signals: largest correction {largest:.3} deg, fastest {fastest:.3} deg/s");
}

#[test]
fn wrong_cameras_move_tip_within_budget_and_limit() {
    // One of every kind, at every rate.
    campaign((0..KINDS).map(|kind| 5 * kind + kind % 5), 12);
    // Here the budget limits one motor.
    campaign(iter::once(201), 20);
}

#[test]
#[ignore = "a thousand signals take an hour: for people"]
fn thousand_wrong_cameras_move_tip_within_budget_and_limit() {
    campaign(0..1020, 20);
}
