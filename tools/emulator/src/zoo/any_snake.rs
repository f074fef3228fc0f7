//! A snake of any physics in time steps.

use super::bouc_wen::BoucWen;
use super::dahl::Dahl;
use super::draw::Draw;
use super::frame::Frame;
use super::gear::Gears;
use super::hysteresis::Hysteresis;
use super::lugre::LuGre;
use super::pair::{Pair, between, subtract};
use super::physics::Physics;
use super::prandtl_ishlinskii::PrandtlIshlinskii;
use super::preisach::Preisach;
use super::wire::Wires;
use crate::ageing::{Ageing, Change, Wear};
use crate::snake::Snake;

/// Maximum inner steps of one step: a jump takes bounded time, in coarser steps.
const MAX_INNER_STEPS: u32 = 1000;

/// A snake of any physics: motor positions in, pitch and yaw of the tip out. Pure: the same steps
/// give the same angles to the bit.
#[derive(Debug, Clone)]
pub struct AnySnake(Kind);

#[derive(Debug, Clone)]
enum Kind {
    Springs(Box<Snake>),
    Drawn(Box<ZooSnake>),
}

#[derive(Debug, Clone)]
struct ZooSnake {
    frame: Frame,
    /// Counts, the last finite ones.
    counts: Pair,
    /// Degrees, behind the play.
    travel: Pair,
    mechanism: Mechanism,
    ageing: Ageing,
    wear: Wear,
}

#[derive(Debug, Clone)]
enum Mechanism {
    PrandtlIshlinskii(Box<PrandtlIshlinskii>),
    Preisach(Preisach),
    BoucWen(BoucWen),
    Dahl(Dahl),
    LuGre(LuGre),
    Wires(Wires),
    Gears(Gears),
}

impl Mechanism {
    fn hysteresis(&self) -> &dyn Hysteresis {
        match self {
            Self::PrandtlIshlinskii(plays) => plays.as_ref(),
            Self::Preisach(relays) => relays,
            Self::BoucWen(equation) => equation,
            Self::Dahl(friction) => friction,
            Self::LuGre(friction) => friction,
            Self::Wires(wires) => wires,
            Self::Gears(gears) => gears,
        }
    }

    fn hysteresis_mut(&mut self) -> &mut dyn Hysteresis {
        match self {
            Self::PrandtlIshlinskii(plays) => plays.as_mut(),
            Self::Preisach(relays) => relays,
            Self::BoucWen(equation) => equation,
            Self::Dahl(friction) => friction,
            Self::LuGre(friction) => friction,
            Self::Wires(wires) => wires,
            Self::Gears(gears) => gears,
        }
    }
}

impl From<Snake> for AnySnake {
    fn from(snake: Snake) -> Self {
        Self(Kind::Springs(Box::new(snake)))
    }
}

impl AnySnake {
    /// Straight and at rest. `physics` is not [`Physics::Springs`], which has a frame of its own.
    /// `seed` determines what is random about ageing.
    pub(super) fn drawn(physics: Physics, draw: &mut Draw, seed: u64) -> Self {
        let frame = Frame::draw(draw);
        let gain = frame.deg_per_count;
        let mechanism = match physics {
            Physics::Springs | Physics::PrandtlIshlinskii => {
                Mechanism::PrandtlIshlinskii(Box::new(PrandtlIshlinskii::draw(draw, gain)))
            }
            Physics::Preisach => Mechanism::Preisach(Preisach::draw(draw, gain)),
            Physics::BoucWen => Mechanism::BoucWen(BoucWen::draw(draw, gain)),
            Physics::Dahl => Mechanism::Dahl(Dahl::draw(draw, gain)),
            Physics::LuGre => Mechanism::LuGre(LuGre::draw(draw, gain)),
            Physics::Wire => Mechanism::Wires(Wires::draw(draw, gain)),
            Physics::Gear => Mechanism::Gears(Gears::draw(draw, gain)),
        };
        Self(Kind::Drawn(Box::new(ZooSnake {
            frame,
            counts: Pair::default(),
            travel: Pair::default(),
            mechanism,
            ageing: Ageing::new(&[], seed),
            wear: Wear::NONE,
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
    #[must_use]
    pub fn angles_deg(&self) -> [f64; 2] {
        match &self.0 {
            Kind::Springs(snake) => snake.angles_deg(),
            Kind::Drawn(snake) => {
                let bend = snake.mechanism.hysteresis().bend();
                snake.wear.seen(snake.frame.angles_deg(bend))
            }
        }
    }

    /// Force of each motor on its wires, degrees of wire stretch; 0 where the motor runs free.
    #[must_use]
    pub fn load(&self) -> [f64; 2] {
        match &self.0 {
            Kind::Springs(snake) => snake.load(),
            Kind::Drawn(snake) => snake.load(),
        }
    }

    /// A change of this snake begins, after its own `start_s`. It has been checked
    /// ([`Change::check`]).
    pub fn begin_ageing(&mut self, change: Change) {
        match &mut self.0 {
            Kind::Springs(snake) => snake.begin_ageing(change),
            Kind::Drawn(snake) => snake.ageing.begin(change),
        }
    }
}

impl ZooSnake {
    fn step(&mut self, dt_s: f64, motor_counts: Pair) {
        let dt_s = if dt_s.is_finite() { dt_s.max(0.0) } else { 0.0 };
        if let Some(wear) = self.ageing.step(dt_s) {
            self.mechanism.hysteresis_mut().set_wear(&wear);
            self.wear = wear;
        }
        let from = self.travel;
        let ahead = self.ahead(motor_counts);
        let play = self.play_deg();
        self.travel = [0, 1].map(|motor: usize| {
            from[motor].clamp(ahead[motor] - play[motor], ahead[motor] + play[motor])
        });
        let moved = subtract(self.travel, from);
        let hysteresis = self.mechanism.hysteresis_mut();
        let longest = moved[0].abs().max(moved[1].abs());
        let steps = (longest / hysteresis.largest_step_deg()).ceil() as u32;
        let steps = steps.clamp(1, MAX_INNER_STEPS);
        let inner_s = dt_s / f64::from(steps);
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            hysteresis.advance(inner_s, between(from, self.travel, share));
        }
    }

    /// Travel of the motors, degrees, in front of the play.
    fn ahead(&mut self, motor_counts: Pair) -> Pair {
        self.frame.travel(motor_counts, &mut self.counts, &self.wear)
    }

    /// Half of the play of each motor by growth of its gap, degrees.
    fn play_deg(&self) -> Pair {
        let lost = self.mechanism.hysteresis().half_lost_deg();
        lost.map_or([0.0; 2], |lost| {
            [0, 1].map(|motor: usize| (self.wear.gap[motor] - 1.0).max(0.0) * lost[motor])
        })
    }

    fn load(&self) -> Pair {
        let mut counts = self.counts;
        let ahead = self.frame.travel(counts, &mut counts, &self.wear);
        let play = self.play_deg();
        let load = self.mechanism.hysteresis().load(self.travel);
        [0, 1].map(|motor: usize| {
            let inside = (ahead[motor] - self.travel[motor]).abs() < play[motor] - 1e-9;
            if inside { 0.0 } else { load[motor] }
        })
    }
}
