//! What the drive does with its motor at present.

use super::state::State;

/// The present task of the drive. Positions are counts of the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Task {
    Off,
    Hold,
    /// The demand is object 0x607A.
    Cyclic,
    /// A trapezoidal profile to a target.
    Profile {
        target: f64,
    },
    /// The speed of object 0x60FF, reached by ramps.
    Velocity,
    /// The speed of object 0x60FF at once.
    CyclicVelocity,
    /// The torque of object 0x6071.
    Torque,
    /// Moves towards a hard stop until the current has been high for long enough.
    SearchStop {
        /// Counts per second, signed.
        speed: f64,
        /// How long the current has been above its threshold.
        pressed_s: f64,
    },
    /// A ramp to standstill; then holds, or disables the power stage and changes the state.
    Brake {
        /// Counts per second squared.
        deceleration: f64,
        /// The state after the ramp.
        then: Option<State>,
    },
}

impl Task {
    /// Whether the drive is about to leave its present state.
    pub(super) const fn is_leaving(self) -> bool {
        matches!(self, Self::Brake { then: Some(_), .. })
    }
}
