//! A snake of any physics in time steps.

use super::Physics;
use super::bouc_wen::BoucWen;
use super::friction::{Creep, Dahl, LuGre, VectorFriction};
use super::hysteresis::{Draw, Hysteresis, Pair, between, motors, subtract};
use super::operators::{PrandtlIshlinskii, Preisach};
use super::springs::SpringSnake;
use super::transmission::{Gear, TransmissionError, Wire};
use crate::ageing::{Ageing, AgeingEffect, Change};

/// Maximum inner steps of one step: a jump takes bounded time, in coarser steps.
const MAX_INNER_STEPS: u32 = 1000;

/// A snake of any physics: motor positions in, pitch and yaw of the tip out.
#[derive(Debug, Clone)]
pub struct Snake(Kind);

#[derive(Debug, Clone)]
enum Kind {
    Springs(Box<SpringSnake>),
    Drawn(Box<DrawnState>),
}

#[derive(Debug, Clone)]
struct DrawnState {
    frame: Frame,
    transmission: Option<TransmissionError>,
    /// Counts after the transmission error, the last finite ones.
    counts: Pair,
    /// Travel after the play, degrees.
    travel: Pair,
    hysteresis: Box<dyn Hysteresis>,
    ageing: Ageing,
    effect: AgeingEffect,
}

impl From<SpringSnake> for Snake {
    fn from(snake: SpringSnake) -> Self {
        Self(Kind::Springs(Box::new(snake)))
    }
}

impl Snake {
    /// A straight snake at rest, of any physics but springs. `seed` determines random ageing.
    pub(super) fn drawn(physics: Physics, draw: &mut Draw, seed: u64) -> Self {
        let frame = Frame::draw(draw);
        let gain = frame.deg_per_count;
        let hysteresis: Box<dyn Hysteresis> = match physics {
            Physics::Springs | Physics::PrandtlIshlinskii => {
                Box::new(motors::<PrandtlIshlinskii>(draw, gain))
            }
            Physics::Preisach => Box::new(motors::<Preisach>(draw, gain)),
            Physics::BoucWen => Box::new(BoucWen::draw(draw, gain)),
            Physics::Dahl => Box::new(motors::<Dahl>(draw, gain)),
            Physics::LuGre => Box::new(motors::<LuGre>(draw, gain)),
            Physics::Wire => Box::new(motors::<Wire>(draw, gain)),
            Physics::Gear | Physics::TransmissionError => Box::new(motors::<Gear>(draw, gain)),
            Physics::Creep => Box::new(Creep::draw(draw, gain)),
            Physics::VectorFriction => Box::new(VectorFriction::draw(draw, gain)),
        };
        let has_error = physics == Physics::TransmissionError;
        Self(Kind::Drawn(Box::new(DrawnState {
            frame,
            transmission: has_error.then(|| TransmissionError::draw(draw)),
            counts: Pair::default(),
            travel: Pair::default(),
            hysteresis,
            ageing: Ageing::new(&[], seed),
            effect: AgeingEffect::NONE,
        })))
    }

    /// Moves the motors uniformly to `motor_counts` within `dt_s` seconds. Counts may be
    /// fractional: they are positions of the motor, not of the encoder. A value that is not finite
    /// leaves its motor in place; a time that is not finite or below 0 counts as 0.
    pub fn step(&mut self, dt_s: f64, motor_counts: [f64; 2]) {
        match &mut self.0 {
            Kind::Springs(snake) => snake.step(dt_s, motor_counts),
            Kind::Drawn(snake) => snake.step(dt_s, motor_counts),
        }
    }

    /// Pitch and yaw of the tip, degrees.
    pub fn angles_deg(&self) -> [f64; 2] {
        match &self.0 {
            Kind::Springs(snake) => snake.angles_deg(),
            Kind::Drawn(snake) => {
                let bend = snake.hysteresis.bend(&snake.effect);
                snake.effect.seen(snake.frame.angles_deg(bend))
            }
        }
    }

    /// Force of each motor on its wires, degrees of wire stretch; 0 where the motor runs free.
    pub fn load(&self) -> [f64; 2] {
        match &self.0 {
            Kind::Springs(snake) => snake.load(),
            Kind::Drawn(snake) => snake.load(),
        }
    }

    /// Starts a change of this snake, checked by [`Change::check`], after its own `start_s`.
    pub fn begin_ageing(&mut self, change: Change) {
        match &mut self.0 {
            Kind::Springs(snake) => snake.begin_ageing(change),
            Kind::Drawn(snake) => snake.ageing.begin(change),
        }
    }
}

impl DrawnState {
    fn step(&mut self, dt_s: f64, motor_counts: Pair) {
        let dt_s = if dt_s.is_finite() { dt_s.max(0.0) } else { 0.0 };
        self.effect = self.ageing.step(dt_s).unwrap_or(self.effect);
        let from = self.travel;
        let counts = self.transmission.map_or(motor_counts, |error| error.turned(motor_counts));
        let ahead = self.frame.travel(counts, &mut self.counts, &self.effect);
        let play = self.play_deg();
        self.travel = [0, 1].map(|motor: usize| {
            from[motor].clamp(ahead[motor] - play[motor], ahead[motor] + play[motor])
        });
        let moved = subtract(self.travel, from);
        let hysteresis = &mut self.hysteresis;
        let longest = moved[0].abs().max(moved[1].abs());
        let steps = (longest / hysteresis.largest_step_deg()).ceil() as u32;
        let steps = steps.clamp(1, MAX_INNER_STEPS);
        let inner_s = dt_s / f64::from(steps);
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            hysteresis.advance(inner_s, between(from, self.travel, share), &self.effect);
        }
    }

    /// Half of the play that each motor has from gap growth, degrees.
    fn play_deg(&self) -> Pair {
        let lost = self.hysteresis.half_lost_deg();
        lost.map_or([0.0; 2], |lost| {
            [0, 1].map(|motor: usize| (self.effect.gap[motor] - 1.0).max(0.0) * lost[motor])
        })
    }

    fn load(&self) -> Pair {
        let mut counts = self.counts;
        let ahead = self.frame.travel(counts, &mut counts, &self.effect);
        let play = self.play_deg();
        let load = self.hysteresis.load(self.travel, &self.effect);
        [0, 1].map(|motor: usize| {
            let inside = (ahead[motor] - self.travel[motor]).abs() < play[motor] - 1e-9;
            if inside { 0.0 } else { load[motor] }
        })
    }
}

/// Largest valid motor position, counts.
const MAX_COUNTS: f64 = 1e4;

/// Maps counts to travel, and bends to pitch and yaw; shared by all drawn snakes. No memory.
#[derive(Debug, Clone, PartialEq)]
struct Frame {
    /// Wire travel per count, degrees of bend without losses.
    deg_per_count: Pair,
    /// Share of the other motor's travel that a motor's wires see: the pulleys share an axle.
    pull: Pair,
    /// The plane that each motor bends, as a direction in pitch and yaw.
    planes: [Pair; 2],
    /// Bend at which the gain has fallen to 0.71, degrees: joints stiffen.
    softening_deg: f64,
    /// Gain difference between the two directions of pitch and of yaw.
    asymmetry: Pair,
}

impl Frame {
    fn draw(draw: &mut Draw) -> Self {
        let gain = draw.uniform(0.0225, 0.026);
        // As on the robot, the motors bend at 45 degrees to pitch and yaw, with this tolerance.
        let turn = 45.0 + draw.uniform(-6.0, 6.0);
        let planes = [turn, turn + 90.0 + draw.uniform(-5.0, 5.0)].map(|angle: f64| {
            let (sin, cos) = angle.to_radians().sin_cos();
            [cos, sin]
        });
        Self {
            deg_per_count: draw.both(0.95, 1.05).map(|factor| gain * factor),
            pull: draw.both(-0.12, 0.12),
            planes,
            softening_deg: draw.uniform(80.0, 150.0),
            asymmetry: draw.both(-0.06, 0.06),
        }
    }

    /// Wire travel, degrees. A position that is not finite leaves its motor where it was.
    fn travel(&self, counts: Pair, last: &mut Pair, effect: &AgeingEffect) -> Pair {
        for (last, counts) in last.iter_mut().zip(counts) {
            if counts.is_finite() {
                *last = counts.clamp(-MAX_COUNTS, MAX_COUNTS);
            }
        }
        let own = [0, 1].map(|motor: usize| {
            effect.gain[motor] * self.deg_per_count[motor] * last[motor] + effect.travel_deg[motor]
        });
        [0, 1].map(|motor: usize| own[motor] + self.pull[motor] * own[1 - motor])
    }

    /// Pitch and yaw, degrees.
    fn angles_deg(&self, bend: Pair) -> Pair {
        let [first, second] = self.planes;
        let angles = [0, 1].map(|axis: usize| bend[0] * first[axis] + bend[1] * second[axis]);
        let far = angles[0].hypot(angles[1]) / self.softening_deg;
        let softer = 1.0 / (1.0 + far * far).sqrt();
        [0, 1].map(|axis: usize| {
            let angle = softer * angles[axis];
            // The corner at 0 is rounded over some degrees.
            angle * (1.0 + self.asymmetry[axis] * (angle / 10.0).tanh())
        })
    }
}
