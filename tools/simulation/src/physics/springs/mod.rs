//! The snake with the hysteresis of gears, wires and friction.
//!
//! Pure. The same steps from the same seed give the same angles to the bit.
//!
//! # Glossary
//!
//! - **wire travel**: how far a motor has pulled its wires, in degrees of the bend that this would
//!   cause without losses.
//! - **slack**: how loose a wire is while the snake is straight. While both wires of a motor are
//!   loose, the snake hardly follows.
//! - **bristle**: an elastic element between two sliding surfaces (LuGre model; Canudas de Wit and
//!   others 1995). It deflects up to a break-away force and then slips. Here that force grows with
//!   the tension of the wires by the capstan equation. In the joints its limit is a circle in the
//!   plane of pitch and yaw: sliding in one axis reduces the friction in the other.
//! - **segment**: a part of the snake with its own stiffness and friction. Segments bend one after
//!   the other, which causes several slopes in one movement.
//!
//! | file | content |
//! |---|---|
//! | `config` | parameters, from a file or at random |
//! | `force_balance` | the force balance in one step, and its solver |
//! | `forces` | force laws with their slopes; friction of a segment |

mod config;
mod force_balance;
mod forces;
#[cfg(test)]
pub(crate) mod tests;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

pub use config::{
    BristleConfig, DriftConfig, FrictionConfig, GearConfig, SegmentConfig, SnakeConfig,
    SnakeConfigError, WireConfig,
};
use force_balance::{State, Step, flank_force};

use super::hysteresis::{Pair, add, subtract};
use crate::ageing::{Ageing, AgeingEffect, Change};

/// Wire travel per inner step, degrees, about a count: friction follows the tension in steps.
const INNER_STEP_DEG: f64 = 0.02;
/// Maximum inner steps of one step: a jump takes bounded time, in coarser steps.
const MAX_INNER_STEPS: u32 = 1000;
/// Largest valid motor position, counts.
const MAX_COUNTS: f64 = 1e6;
/// Shortest time step, seconds, so that the drag stays finite.
const MIN_STEP_S: f64 = 1e-9;

/// One snake. It starts straight, with loose wires and without memory.
#[derive(Debug, Clone)]
pub struct SpringSnake {
    /// Parameters when new.
    new: SnakeConfig,
    /// Present parameters.
    config: SnakeConfig,
    axes: [Pair; 2],
    state: State,
    drift: SlowChange,
    ageing: Ageing,
    effect: AgeingEffect,
}

impl SpringSnake {
    /// A snake with these parameters. `seed` determines random drift and ageing.
    pub fn new(config: &SnakeConfig, seed: u64) -> Self {
        let (sin, cos) = config.motor_axes_deg.to_radians().sin_cos();
        Self {
            axes: [[cos, sin], [-sin, cos]],
            state: State::default(),
            drift: SlowChange::new(&config.drift, seed),
            ageing: Ageing::new(&config.ageing, seed),
            effect: AgeingEffect::NONE,
            new: config.clone(),
            config: config.clone(),
        }
    }

    /// Moves the motors uniformly to `motor_counts` within `dt_s` seconds. Counts may be
    /// fractional: they are positions of the motor, not of the encoder. A value that is not finite
    /// leaves its motor in place; a time that is not finite or below 0 counts as 0.
    pub fn step(&mut self, dt_s: f64, motor_counts: [f64; 2]) {
        let dt_s = if dt_s.is_finite() { dt_s.max(0.0) } else { 0.0 };
        self.drift.step(dt_s);
        if let Some(effect) = self.ageing.step(dt_s) {
            self.config = self.new.aged(&effect);
            self.effect = effect;
        }
        let from = self.state.motor;
        let travel = subtract(self.wire_travel(motor_counts), from);
        let longest = travel[0].abs().max(travel[1].abs());
        let steps = ((longest / INNER_STEP_DEG).ceil() as u32).clamp(1, MAX_INNER_STEPS);
        let inner_s = (dt_s / f64::from(steps)).max(MIN_STEP_S);
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            self.inner_step(inner_s, add(from, travel.map(|travel| share * travel)));
        }
    }

    /// Pitch and yaw of the tip, degrees.
    pub fn angles_deg(&self) -> [f64; 2] {
        self.effect.seen(add(self.state.total_bend(), self.drift.offset_deg))
    }

    /// Force of each motor on its gear, degrees of wire stretch; 0 inside the backlash.
    pub(crate) fn load(&self) -> [f64; 2] {
        let travel = subtract(self.state.motor, self.state.pulley);
        [0, 1].map(|motor: usize| flank_force(&self.config.gear, motor, travel[motor]).value)
    }

    pub(crate) fn begin_ageing(&mut self, change: Change) {
        self.ageing.begin(change);
    }

    fn wire_travel(&self, motor_counts: [f64; 2]) -> Pair {
        let mut travel = self.state.motor;
        for (motor, counts) in motor_counts.into_iter().enumerate() {
            if counts.is_finite() {
                let gain = self.config.deg_per_count * self.effect.gain[motor];
                let counts = counts.clamp(-MAX_COUNTS, MAX_COUNTS);
                travel[motor] = gain * counts + self.effect.travel_deg[motor];
            }
        }
        travel
    }

    fn inner_step(&mut self, dt_s: f64, motor: Pair) {
        let drift = self.drift.friction_factor();
        let friction = self.effect.friction.map(|aged| drift * aged);
        let step = Step::new(&self.config, self.axes, self.state, motor, dt_s, friction);
        self.state = step.solve();
        let left = (-dt_s / self.config.drift.creep_time_s).exp();
        self.state.bristles.iter_mut().for_each(|bristles| bristles.creep(left));
    }
}

/// The grid, seconds; a power of two, so that sums of steps are exact.
const GRID_S: f64 = 0.125;
/// Longest simulated pause: after it the process is independent of its past.
const MAX_PAUSE_S: f64 = 36_000.0;

/// Slow random changes of friction and the zero: Ornstein-Uhlenbeck processes with a known standard
/// deviation in the long run, on a fixed grid: the path does not depend on the steps of the caller.
#[derive(Debug, Clone)]
struct SlowChange {
    config: DriftConfig,
    random: Pcg64Mcg,
    /// Time since the last point of the grid.
    pending_s: f64,
    /// Zero of pitch and yaw, degrees.
    offset_deg: [f64; 2],
    /// Relative change of the friction.
    friction: f64,
}

impl SlowChange {
    /// Starts at 0.
    fn new(config: &DriftConfig, seed: u64) -> Self {
        Self {
            config: config.clone(),
            random: Pcg64Mcg::seed_from_u64(seed),
            pending_s: 0.0,
            offset_deg: [0.0; 2],
            friction: 0.0,
        }
    }

    /// Advances by `dt_s` seconds.
    fn step(&mut self, dt_s: f64) {
        self.pending_s = (self.pending_s + dt_s).min(MAX_PAUSE_S);
        while self.pending_s >= GRID_S {
            self.pending_s -= GRID_S;
            let (config, random) = (&self.config, &mut self.random);
            for offset in &mut self.offset_deg {
                advance(offset, config.offset_deg, config.offset_time_s, random);
            }
            advance(&mut self.friction, config.friction, config.friction_time_s, random);
        }
    }

    /// The factor on all friction, near 1.
    fn friction_factor(&self) -> f64 {
        (1.0 + self.friction).max(0.1)
    }
}

/// One exact step of the grid: `x <- a x + deviation sqrt(1 - a^2) noise`, `a = exp(-dt / time)`.
fn advance(value: &mut f64, deviation: f64, time_s: f64, random: &mut Pcg64Mcg) {
    let noise: f64 = StandardNormal.sample(random);
    let keep = (-GRID_S / time_s).exp();
    *value = keep * *value + deviation * (1.0 - keep * keep).sqrt() * noise;
}
