//! The snake: motor positions in, pitch and yaw of the tip out, with the hysteresis of gears, wires
//! and friction.
//!
//! Pure: no clock, no input, no output. The same steps from the same seed give the same angles to
//! the bit, so it serves the live emulator and offline research alike.
//!
//! # Words
//!
//! - **wire travel**: how far a motor has pulled its wires, in degrees of the bend that it would
//!   give without losses.
//! - **slack**: how far a wire hangs loose while the snake is straight. While both wires of a motor
//!   hang loose, the snake hardly follows.
//! - **bristle**: an elastic hair between two sliding surfaces (LuGre; Canudas de Wit and others
//!   1995). It holds up to a break-away force and then slips. Here that force grows with the
//!   tension of the wires by the rope formula. In the joints its limit is a circle in the plane of
//!   pitch and yaw: one axis that slips leaves the other less to hold on to.
//! - **segment**: a stretch of the snake with a stiffness and friction of its own. Segments bend
//!   one after the other, which makes several slopes on one stroke.
//!
//! | file | holds |
//! |---|---|
//! | `config` | the parameters and their file |
//! | `law` | the force laws |
//! | `balance` | the balance of forces in one step |
//! | `friction` | bristles and their limits |
//! | `newton` | the solver of that balance |
//! | `drift` | what wanders with time |

mod balance;
mod config;
mod drift;
mod friction;
mod law;
mod newton;
#[cfg(test)]
mod schema_file;

pub use config::{
    BristleConfig, DriftConfig, FrictionConfig, GearConfig, SegmentConfig, SnakeConfig,
    SnakeConfigError, WireConfig,
};

use balance::{State, Step};
use drift::Drift;

/// The most segments of a snake.
pub const MAX_SEGMENTS: usize = 4;

/// The most kinds of bristles.
pub const MAX_BRISTLES: usize = 4;

/// Wire travel per inner step, degrees, about one count: friction limits follow the tension from
/// step to step.
const INNER_STEP_DEG: f64 = 0.02;

/// The most inner steps of one step: a jump costs bounded time and is taken in coarser steps.
const MAX_INNER_STEPS: u32 = 1000;

/// Positions beyond this make no sense for any motor of ours, counts.
const POSITION_BOUND_COUNTS: f64 = 1e6;

/// Time steps are taken as at least this, seconds, so that the drag stays finite.
const SHORTEST_STEP_S: f64 = 1e-9;

/// Pitch and yaw, or motor 0 and motor 1.
type Pair = [f64; 2];

fn dot(a: Pair, b: Pair) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// What goes on inside the snake, for logs and plots.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SnakeTruth {
    /// Where the pulleys are, degrees of wire travel.
    pub pulley_deg: [f64; 2],
    /// Bends of the segments from base to tip, pitch and yaw, degrees; unused ones are 0.
    pub bend_deg: [[f64; 2]; MAX_SEGMENTS],
    /// The wandering zero, pitch and yaw, degrees. It is part of the angles.
    pub offset_deg: [f64; 2],
    /// The wandering factor on the friction.
    pub friction_factor: f64,
}

/// One snake. Starts straight, with all wires loose and no memory.
#[derive(Debug, Clone)]
pub struct Snake {
    config: SnakeConfig,
    axes: [[f64; 2]; 2],
    state: State,
    drift: Drift,
}

impl Snake {
    /// A snake with these parameters. `seed` determines what wanders.
    #[must_use]
    pub fn new(config: &SnakeConfig, seed: u64) -> Self {
        let (sin, cos) = config.motor_axes_deg.to_radians().sin_cos();
        Self {
            axes: [[cos, sin], [-sin, cos]],
            state: State::default(),
            drift: Drift::new(&config.drift, seed),
            config: config.clone(),
        }
    }

    /// Moves the motors evenly to `motor_counts` within `dt_s` seconds. Counts may be fractional:
    /// the snake hangs on the motor, not on the encoder. Values that are not finite leave that
    /// motor where it was; a time that is not finite or below 0 counts as no time.
    pub fn step(&mut self, dt_s: f64, motor_counts: [f64; 2]) {
        let dt_s = if dt_s.is_finite() { dt_s.max(0.0) } else { 0.0 };
        self.drift.step(dt_s);
        let (from, to) = (self.state.motor, self.wire_travel(motor_counts));
        let longest = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
        let steps = ((longest / INNER_STEP_DEG).ceil() as u32).clamp(1, MAX_INNER_STEPS);
        let inner_s = (dt_s / f64::from(steps)).max(SHORTEST_STEP_S);
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            let motor = [
                from[0] + share * (to[0] - from[0]),
                from[1] + share * (to[1] - from[1]),
            ];
            self.inner_step(inner_s, motor);
        }
    }

    /// Pitch and yaw of the tip, degrees.
    #[must_use]
    pub fn angles_deg(&self) -> [f64; 2] {
        let (bend, offset) = (self.state.total_bend(), self.drift.offset_deg());
        [bend[0] + offset[0], bend[1] + offset[1]]
    }

    /// What goes on inside.
    #[must_use]
    pub fn truth(&self) -> SnakeTruth {
        SnakeTruth {
            pulley_deg: self.state.pulley,
            bend_deg: self.state.bend,
            offset_deg: self.drift.offset_deg(),
            friction_factor: self.drift.friction_factor(),
        }
    }

    /// The parameters.
    #[must_use]
    pub fn config(&self) -> &SnakeConfig {
        &self.config
    }

    fn wire_travel(&self, motor_counts: [f64; 2]) -> [f64; 2] {
        let mut travel = self.state.motor;
        for (travel, counts) in travel.iter_mut().zip(motor_counts) {
            if counts.is_finite() {
                *travel = self.config.deg_per_count
                    * counts.clamp(-POSITION_BOUND_COUNTS, POSITION_BOUND_COUNTS);
            }
        }
        travel
    }

    fn inner_step(&mut self, dt_s: f64, motor: [f64; 2]) {
        let step = Step::new(
            &self.config,
            self.axes,
            self.state,
            motor,
            dt_s,
            self.drift.friction_factor(),
        );
        self.state = step.solve();
        let left = (-dt_s / self.config.drift.creep_time_s).exp();
        self.state.creep(left);
    }
}

#[cfg(test)]
pub(crate) mod tests;
