//! Does the current of a motor show how far it runs free, without a camera?
//!
//! Inside a gap nothing loads the motor: its current is that of its own friction. Emulated motors
//! go to and fro with a snake behind them, new and worn; the current is read at an interval, as
//! over a serial line, with the resolution and noise of a drive. The travel between readings
//! without load is the free travel. It is compared with the true one, and its growth with that of
//! the gap.
//!
//! `cargo run --release -p i2ris-simulation --example current_at_reversal`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::f64::consts::TAU;

use i2ris_simulation::ageing::{Change, Course, Parameter};
use i2ris_simulation::drive::{Limits, Motor, MotorConfig};
use i2ris_simulation::physics::{DrawnSnake, Physics, Snake};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const STEP_S: f64 = 5e-4;
const SECONDS: f64 = 120.0;

/// Growth of the gap of the worn snake.
const GROWTH: f64 = 0.4;

/// Intervals of the readings, s. A reading takes the place of one set-point on a line: with a
/// set-point every 4 ms, 80 ms leave 95 % of them.
const INTERVALS_S: [f64; 3] = [0.004, 0.02, 0.08];

/// Standard deviation of a reading, mA.
const NOISE_MA: f64 = 0.3;

/// A growth that is found this well can be used.
const WITHIN: f64 = 0.15;

/// Readings this near to the friction of the motor are without load, mA.
const FREE_MA: f64 = 1.0;

/// Slower motors show no friction, counts/s.
const LEAST_SPEED: f64 = 30.0;

const LIMITS: Limits = Limits { current_ma: 300.0, speed: 51_200.0 };

fn main() {
    println!(
        "growth of the free travel of motor 0 per reversal, counts, where the gap grew by \
         {GROWTH}: true, and from readings of the current every {INTERVALS_S:?} s\n"
    );
    let mut off = INTERVALS_S.map(|_| Vec::new());
    for physics in [Physics::Gear, Physics::Dahl, Physics::Preisach, Physics::Wire] {
        for seed in 2..=6 {
            let drawn = DrawnSnake { physics, seed };
            let [new, worn] = [0.0, GROWTH].map(|growth| run(drawn, growth));
            let truth = worn.truth - new.truth;
            let found: [f64; INTERVALS_S.len()] =
                std::array::from_fn(|interval| worn.found[interval] - new.found[interval]);
            println!("{drawn:<12} {truth:6.1}   {found:6.1?}");
            for (off, found) in off.iter_mut().zip(found) {
                off.push((found / truth - 1.0).abs());
            }
        }
    }
    for (interval_s, off) in INTERVALS_S.iter().zip(&mut off) {
        let within = off.iter().filter(|off| **off <= WITHIN).count();
        off.sort_by(f64::total_cmp);
        println!(
            "every {interval_s} s: off by {:.0} % in the median, {within} of {} within {:.0} %",
            100.0 * off[off.len() / 2],
            off.len(),
            100.0 * WITHIN
        );
    }
}

/// Free travel per reversal, counts.
struct Free {
    truth: f64,
    found: [f64; INTERVALS_S.len()],
}

fn run(drawn: DrawnSnake, growth: f64) -> Free {
    let config = MotorConfig::default();
    let mut snake = worn(drawn, growth);
    let mut motors = [Motor::default(); 2];
    let mut random = Pcg64Mcg::seed_from_u64(drawn.seed);
    let mut readings = INTERVALS_S.map(Readings::new);
    let (mut truth, mut reversals, mut direction) = (0.0, 0, 0.0);
    for step in 0..(SECONDS / STEP_S) as u64 {
        let time = step as f64 * STEP_S;
        for (motor, hz) in motors.iter_mut().zip([0.21, 0.17]) {
            let to = 1500.0 * (TAU * hz * time).sin() * (time / 3.0).min(1.0);
            motor.follow(&config, to.round(), LIMITS, STEP_S);
        }
        snake.step(STEP_S, motors.map(|motor| motor.position));
        let load = snake.load();
        for (motor, load) in motors.iter_mut().zip(load) {
            motor.load = load;
        }
        let motor = motors[0];
        if motor.velocity.abs() >= LEAST_SPEED {
            reversals += u32::from(motor.velocity * direction < 0.0);
            direction = motor.velocity;
            if load[0] == 0.0 {
                truth += motor.velocity.abs() * STEP_S;
            }
        }
        let noise = NOISE_MA * 1.7 * random.random_range(-1.0..1.0);
        for readings in &mut readings {
            readings.add(time, &motor, (motor.current_ma + noise).round(), &config);
        }
    }
    let per_reversal = |travel: f64| travel / f64::from(reversals);
    Free { truth: per_reversal(truth), found: readings.map(|readings| per_reversal(readings.free)) }
}

fn worn(drawn: DrawnSnake, growth: f64) -> Snake {
    let mut snake = drawn.build();
    snake.begin_ageing(Change {
        parameter: Parameter::Gap,
        by: growth,
        start_s: 0.0,
        motor: None,
        direction: None,
        course: Course::Step {},
    });
    snake.step(1.0, [0.0; 2]);
    snake
}

/// Readings of the current of a motor, with its speed between them.
struct Readings {
    interval_s: f64,
    next_s: f64,
    last: f64,
    was_free: bool,
    /// Travel without load, counts.
    free: f64,
}

impl Readings {
    fn new(interval_s: f64) -> Self {
        Self { interval_s, next_s: 0.0, last: 0.0, was_free: false, free: 0.0 }
    }

    fn add(&mut self, time: f64, motor: &Motor, current_ma: f64, config: &MotorConfig) {
        if time < self.next_s {
            return;
        }
        self.next_s += self.interval_s;
        let position = motor.position.round();
        let travel = position - self.last;
        self.last = position;
        let friction = config.friction_ma.copysign(travel);
        let is_free = travel.abs() >= LEAST_SPEED * self.interval_s
            && (current_ma - friction).abs() <= FREE_MA;
        // Half of the travel at each end of a free stretch belongs to it.
        let share = 0.5 * (f64::from(u8::from(is_free)) + f64::from(u8::from(self.was_free)));
        self.free += share * travel.abs();
        self.was_free = is_free;
    }
}
