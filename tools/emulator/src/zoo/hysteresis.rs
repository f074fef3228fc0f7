//! What a physics has to do: wire travel in, bend of each motor out.

use super::pair::Pair;

/// A hysteresis of both motors.
pub(super) trait Hysteresis {
    /// Longest travel of a motor in one step, degrees; infinite where a straight way is exact.
    fn largest_step_deg(&self) -> f64;

    /// Moves the wires uniformly to `travel`, degrees, within `dt_s` seconds.
    fn advance(&mut self, dt_s: f64, travel: Pair);

    /// The bend that each motor causes, degrees.
    fn bend(&self) -> Pair;
}
