//! The snake in time steps.

use super::config::SnakeConfig;
use super::drift::SlowChange;
use super::force_balance::{Drive, State, Step, flank};
use crate::ageing::{Ageing, AgeingEffect, Change};
use crate::physics::draw::{Pair, add, subtract};

/// Wire travel per inner step, degrees, about one count: the friction limits follow the tension
/// from step to step.
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
        let bend = add(self.state.total_bend(), self.drift.offset_deg());
        self.effect.seen(bend)
    }

    /// Force of each motor on its gear, degrees of wire stretch; 0 inside the backlash.
    pub(crate) fn load(&self) -> [f64; 2] {
        [0, 1].map(|motor: usize| flank(&self.config.gear, motor, &self.state))
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
        let step = Step::new(&self.config, self.axes, self.state, Drive { motor, dt_s, friction });
        self.state = step.solve();
        let left = (-dt_s / self.config.drift.creep_time_s).exp();
        self.state.creep(left);
    }
}
