//! Interface of a physics: wire travel in, bend of each motor out. Pairs of values, random
//! parameters, friction that grows with the bend, as the wires press harder on their guides.

use std::fmt::Debug;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::ageing::AgeingEffect;

/// A theory. `aged` is how its parameters differ from those of a new snake.
pub(super) trait Hysteresis: Copied + Debug + Send + Sync {
    /// Longest travel of a motor in one step, degrees; infinite where one straight step is exact.
    fn largest_step_deg(&self) -> f64;

    /// Moves the wires uniformly to `travel`, degrees, within `dt_s` seconds.
    fn advance(&mut self, dt_s: f64, travel: Pair, aged: &AgeingEffect);

    /// The bend that each motor causes, degrees.
    fn bend(&self, aged: &AgeingEffect) -> Pair;

    /// Half of the lost motion when new, degrees, if the theory has no gap of its own to grow.
    fn half_lost_deg(&self) -> Option<Pair>;

    /// Force of each motor on its wires at a travel, degrees of wire stretch.
    fn load(&self, travel: Pair, aged: &AgeingEffect) -> Pair {
        let bend = self.bend(aged);
        [0, 1].map(|motor: usize| spring(travel[motor], bend[motor]))
    }
}

/// Stiffness of the snake relative to the wire.
pub(super) const SNAKE_STIFFNESS: f64 = 0.15;

/// The spring of the snake, plus the force that stretches the wire.
fn spring(travel: f64, bend: f64) -> f64 {
    SNAKE_STIFFNESS * bend + travel - bend
}

/// Ageing of one motor: factors on what it was when new.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Aged {
    pub gap: f64,
    pub preload: f64,
    pub friction: f64,
}

impl Aged {
    fn of(effect: &AgeingEffect, motor: usize) -> Self {
        let AgeingEffect { gap, preload, friction, .. } = effect;
        Self { gap: gap[motor], preload: preload[motor], friction: friction[motor] }
    }
}

/// One motor of a physics whose motors know only where the other is. Methods: [`Hysteresis`].
pub(super) trait Motor: Clone + Debug + Send + Sync + 'static {
    const LARGEST_STEP_DEG: f64 = f64::INFINITY;

    /// `half_gap`: half of the lost motion, degrees.
    fn draw(draw: &mut Draw, half_gap: f64) -> Self;

    /// `before`: where this motor and the other were.
    fn advance(&mut self, dt_s: f64, travel: f64, before: Pair, aged: &Aged);

    fn bend(&self) -> f64;

    /// Where the other motor sees it, degrees.
    fn at(&self) -> f64 {
        self.bend()
    }

    fn half_lost_deg(&self) -> Option<f64> {
        None
    }

    fn load(&self, travel: f64, _aged: &Aged) -> f64 {
        spring(travel, self.bend())
    }
}

/// Two motors, made alike.
pub(super) fn motors<M: Motor>(draw: &mut Draw, deg_per_count: Pair) -> [M; 2] {
    draw.half_gaps_deg(deg_per_count).map(|half_gap| M::draw(draw, half_gap))
}

impl<M: Motor> Hysteresis for [M; 2] {
    fn largest_step_deg(&self) -> f64 {
        M::LARGEST_STEP_DEG
    }

    fn advance(&mut self, dt_s: f64, travel: Pair, aged: &AgeingEffect) {
        let before = self.each_ref().map(M::at);
        for (motor, state) in self.iter_mut().enumerate() {
            let (before, aged) = ([before[motor], before[1 - motor]], Aged::of(aged, motor));
            state.advance(dt_s, travel[motor], before, &aged);
        }
    }

    fn bend(&self, _aged: &AgeingEffect) -> Pair {
        self.each_ref().map(M::bend)
    }

    fn half_lost_deg(&self) -> Option<Pair> {
        Some([self[0].half_lost_deg()?, self[1].half_lost_deg()?])
    }

    fn load(&self, travel: Pair, aged: &AgeingEffect) -> Pair {
        [0, 1].map(|motor: usize| self[motor].load(travel[motor], &Aged::of(aged, motor)))
    }
}

/// Copies a `dyn` value.
pub(super) trait Copied {
    fn copied(&self) -> Box<dyn Hysteresis>;
}

impl<T: Hysteresis + Clone + 'static> Copied for T {
    fn copied(&self) -> Box<dyn Hysteresis> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn Hysteresis> {
    fn clone(&self) -> Self {
        self.as_ref().copied()
    }
}

/// Half of the lost motion of a motor, counts, as on robots of this kind.
const HALF_GAP_COUNTS: [f64; 2] = [20.0, 110.0];
/// Spreads the seeds of one physics away from those of another (the golden ratio in 64 bits).
const SPREAD: u64 = 0x9E37_79B9_7F4A_7C15;

#[derive(Debug)]
pub(super) struct Draw(Pcg64Mcg);

impl Draw {
    /// Equal seeds of different streams have nothing in common.
    pub(super) fn new(seed: u64, stream: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed ^ SPREAD.wrapping_mul(stream + 1)))
    }

    pub(super) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Every factor is equally likely.
    pub(super) fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.0.random::<f64>())
    }

    pub(super) fn both(&mut self, low: f64, high: f64) -> Pair {
        [0, 1].map(|_| self.uniform(low, high))
    }

    /// Half of the lost motion of each motor, degrees. Made alike, they differ by a third at most.
    pub(super) fn half_gaps_deg(&mut self, deg_per_count: Pair) -> Pair {
        let [low, high] = HALF_GAP_COUNTS;
        let counts = self.uniform(low / 0.8, high / 1.2);
        deg_per_count.map(|gain| gain * counts * self.uniform(0.8, 1.2))
    }
}

/// Bend at which the growth is counted, degrees.
const FULL_BEND_DEG: f64 = 40.0;

/// Relative friction growth of a motor at full bend, by this motor and by the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrictionGrowth {
    own: f64,
    other: f64,
}

impl FrictionGrowth {
    /// Draws the growth by either motor, up to these limits.
    pub(super) fn draw(draw: &mut Draw, own: f64, other: f64) -> Self {
        Self { own: draw.uniform(0.0, own), other: draw.uniform(0.0, other) }
    }

    /// Factor on the friction at these bends of this motor and the other, degrees.
    pub(super) fn factor(&self, own: f64, other: f64) -> f64 {
        1.0 + (self.own * own.abs() + self.other * other.abs()) / FULL_BEND_DEG
    }
}

/// Pitch and yaw, or motor 0 and motor 1.
pub(super) type Pair = [f64; 2];

pub(super) fn dot(a: Pair, b: Pair) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn add(a: Pair, b: Pair) -> Pair {
    [a[0] + b[0], a[1] + b[1]]
}

pub(super) fn subtract(a: Pair, b: Pair) -> Pair {
    [a[0] - b[0], a[1] - b[1]]
}

/// Interpolates from one pair to another.
pub(super) fn between(from: Pair, to: Pair, share: f64) -> Pair {
    [0, 1].map(|i: usize| from[i] + share * (to[i] - from[i]))
}
