//! Interface of a physics: wire travel in, bend of each motor out.

use std::fmt::Debug;

use super::draw::{Draw, Pair};
use crate::ageing::AgeingEffect;

pub(super) trait Hysteresis: Copied + Debug + Send + Sync {
    /// Longest travel of a motor in one step, degrees; infinite where one straight step is exact.
    fn largest_step_deg(&self) -> f64;

    /// Moves the wires uniformly to `travel`, degrees, within `dt_s` seconds.
    fn advance(&mut self, dt_s: f64, travel: Pair);

    /// The bend that each motor causes, degrees.
    fn bend(&self) -> Pair;

    fn set_ageing(&mut self, effect: &AgeingEffect);

    /// Half of the lost motion of each motor when new, degrees, if the theory has no gap of its own
    /// that could grow.
    fn half_lost_deg(&self) -> Option<Pair>;

    /// Force of each motor on its wires at a travel, degrees of wire stretch.
    fn load(&self, travel: Pair) -> Pair {
        let bend = self.bend();
        [0, 1].map(|motor: usize| spring(travel[motor], bend[motor]))
    }
}

/// Stiffness of the snake relative to the wire.
pub(super) const SNAKE_STIFFNESS: f64 = 0.15;

/// The spring of the snake, plus the force that stretches the wire.
fn spring(travel: f64, bend: f64) -> f64 {
    SNAKE_STIFFNESS * bend + travel - bend
}

/// One motor of a physics in which the motors know of each other no more than where they are. The
/// methods are those of [`Hysteresis`].
pub(super) trait Motor: Clone + Debug + Send + Sync + 'static {
    const LARGEST_STEP_DEG: f64 = f64::INFINITY;

    /// `half_gap`: half of the lost motion, degrees.
    fn draw(draw: &mut Draw, half_gap: f64) -> Self;

    /// `before`: where this motor and the other were.
    fn advance(&mut self, dt_s: f64, travel: f64, before: Pair);

    fn bend(&self) -> f64;

    /// Where the other motor sees it, degrees.
    fn at(&self) -> f64 {
        self.bend()
    }

    /// `motor`: its place in the pairs of the effect.
    fn set_ageing(&mut self, _effect: &AgeingEffect, _motor: usize) {}

    fn half_lost_deg(&self) -> Option<f64> {
        None
    }

    fn load(&self, travel: f64) -> f64 {
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

    fn advance(&mut self, dt_s: f64, travel: Pair) {
        let before = self.each_ref().map(M::at);
        for (motor, state) in self.iter_mut().enumerate() {
            state.advance(dt_s, travel[motor], [before[motor], before[1 - motor]]);
        }
    }

    fn bend(&self) -> Pair {
        self.each_ref().map(M::bend)
    }

    fn set_ageing(&mut self, effect: &AgeingEffect) {
        for (motor, state) in self.iter_mut().enumerate() {
            state.set_ageing(effect, motor);
        }
    }

    fn half_lost_deg(&self) -> Option<Pair> {
        Some([self[0].half_lost_deg()?, self[1].half_lost_deg()?])
    }

    fn load(&self, travel: Pair) -> Pair {
        [0, 1].map(|motor: usize| self[motor].load(travel[motor]))
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
