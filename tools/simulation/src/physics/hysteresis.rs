//! Interface of a physics: wire travel in, bend of each motor out.

use std::fmt::Debug;

use super::draw::Pair;
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

    /// Force of each motor on its wires at a travel, degrees of wire stretch: the spring of the
    /// snake, plus the force that stretches the wire.
    fn load(&self, travel: Pair) -> Pair {
        let bend = self.bend();
        [0, 1].map(|motor: usize| SNAKE_STIFFNESS * bend[motor] + travel[motor] - bend[motor])
    }
}

/// Stiffness of the snake relative to the wire.
pub(super) const SNAKE_STIFFNESS: f64 = 0.15;

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
