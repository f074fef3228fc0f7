//! Friction that grows with the bend: the wires press harder on their guides.

use super::draw::Draw;

/// Bend at which the growth is counted, degrees.
const FULL_BEND_DEG: f64 = 40.0;

/// Growth of the friction of a motor at full bend of this motor and of the other, relative to that
/// of the straight snake.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrictionGrowth {
    own: f64,
    other: f64,
}

impl FrictionGrowth {
    /// Up to so much growth by either motor.
    pub(super) fn draw(draw: &mut Draw, own: f64, other: f64) -> Self {
        Self { own: draw.uniform(0.0, own), other: draw.uniform(0.0, other) }
    }

    /// Factor on the friction at bends of this motor and of the other, degrees.
    pub(super) fn factor(&self, own: f64, other: f64) -> f64 {
        1.0 + (self.own * own.abs() + self.other * other.abs()) / FULL_BEND_DEG
    }
}
