//! Velocity and acceleration limits on the set-point of one motor.
//!
//! # Words
//!
//! - **set-point**: where the motor is told to be in this tick, in fractional counts.
//! - **speed-up, slow-down**: change of the velocity away from zero, towards zero.
//! - **room**: how far a set-point may still go in one direction.
//!
//! # What it promises
//!
//! With limits V (velocity), A (acceleration), D (deceleration, D >= A), tick T, whatever the
//! targets are:
//!
//! - the set-point moves by at most `V T` a tick;
//! - its velocity grows by at most `A T` a tick and shrinks by at most `D T`; in a tick that
//!   crosses zero, what is left of the tick after the slow-down is left for the speed-up;
//! - it never leaves the position limits. One that starts outside never goes further out;
//! - a target that stands still is reached without passing it, if the limits left a choice: a
//!   set-point that moves too fast towards a target that just changed slows down with D and comes
//!   back.
//!
//! The reference is the previous set-point, not the measurement: what the drive does about it does
//! not feed back.
//!
//! # How
//!
//! Braking is planned with A, exactly for discrete ticks. From velocity `u`, lowered by `w = A T`
//! every tick, the set-point travels, this tick included, `T ((n + 1) u - w n (n + 1) / 2)` with
//! `n = floor(u / w)`. The fastest `u` that fits a distance `e` is therefore, with `n` the largest
//! integer such that `w n (n + 1) / 2 <= e / T`,
//!
//! ```text
//! u(e) = e / (T (n + 1)) + w n / 2,    n = floor((sqrt(1 + 8 e / (w T)) - 1) / 2)
//! ```
//!
//! which ends on the target to the last digit, in the fewest ticks. This is the discrete form of
//! `u = sqrt(2 A e)`.
//!
//! The target may move. The plan is made in its frame: the wanted velocity is that of the target
//! plus `u` of what is left after the target has moved. **A target that moves within the limits is
//! therefore followed without lag**: braking towards zero instead would keep the set-point
//! `v^2 / 2A` behind, which is 3.7 counts, or 7 ms, at 12 deg/s.
//!
//! Slowing down harder than planned, up to D, is left for what could not be planned: the target
//! stops, turns round, or comes near a position limit.

use serde::{Deserialize, Serialize};

use crate::units::Nanos;

/// Limits of one motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest velocity, counts per second, above 0.
    pub velocity: f64,
    /// Largest speed-up, counts per second squared, above 0.
    pub acceleration: f64,
    /// Largest slow-down, counts per second squared, not below `acceleration`.
    pub deceleration: f64,
    /// Lowest position, counts.
    pub lowest: f64,
    /// Highest position, counts.
    pub highest: f64,
}

/// Where a motor should be in this tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Target {
    /// Position, counts.
    pub position: f64,
    /// How far `position` has moved since the last tick, counts; 0 if it jumped.
    pub moved: f64,
}

impl Target {
    /// A target that stands still.
    #[must_use]
    pub fn fixed(position: f64) -> Self {
        Self {
            position,
            moved: 0.0,
        }
    }
}

/// Moves the set-point of one motor within its [`Limits`], one step a tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Limiter {
    /// Counts per tick.
    velocity_limit: f64,
    /// Counts per tick, per tick.
    speed_up: f64,
    /// Counts per tick, per tick.
    slow_down: f64,
    lowest: f64,
    highest: f64,
    position: f64,
    /// Counts per tick.
    velocity: f64,
}

impl Limiter {
    /// A limiter for ticks of length `period`, at rest at 0.
    #[must_use]
    pub fn new(limits: &Limits, period: Nanos) -> Self {
        let tick = period.as_seconds();
        // A limit so small that it vanishes would make 0 * infinity below.
        let speed_up = (limits.acceleration * tick * tick).max(f64::MIN_POSITIVE);
        Self {
            velocity_limit: limits.velocity * tick,
            speed_up,
            slow_down: (limits.deceleration * tick * tick).max(speed_up),
            lowest: limits.lowest,
            highest: limits.highest,
            position: 0.0,
            velocity: 0.0,
        }
    }

    /// The set-point, counts.
    #[must_use]
    pub fn position(&self) -> f64 {
        self.position
    }

    /// How far the set-point moved in the last tick, counts.
    #[must_use]
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// The set-point stands still and has no velocity left to lose.
    #[must_use]
    pub fn at_rest(&self) -> bool {
        self.velocity == 0.0
    }

    /// Starts anew at rest at a position, inside the limits or not.
    pub fn restart(&mut self, position: f64) {
        self.position = position;
        self.velocity = 0.0;
    }

    /// One tick towards a target. A target that is not a number stops.
    pub fn follow(&mut self, target: Target) {
        if target.position.is_nan() || !target.moved.is_finite() {
            return self.stop();
        }
        let position = within(target.position, self.lowest, self.highest);
        let gap = position - target.moved - self.position;
        self.advance(target.moved + fastest(gap.abs(), self.speed_up).copysign(gap));
    }

    /// One tick of slowing down, as hard as allowed.
    pub fn stop(&mut self) {
        self.advance(0.0);
    }

    fn advance(&mut self, wanted: f64) {
        let reachable = within(
            wanted,
            -self.reach(-self.velocity),
            self.reach(self.velocity),
        );
        let limited = within(reachable, -self.velocity_limit, self.velocity_limit);
        let (down, up) = (
            self.room(self.position - self.lowest),
            self.room(self.highest - self.position),
        );
        self.velocity = within(limited, -down, up);
        self.position += self.velocity;
    }

    /// The highest velocity that can follow on `velocity`.
    fn reach(&self, velocity: f64) -> f64 {
        if velocity >= 0.0 {
            velocity + self.speed_up
        } else if velocity <= -self.slow_down {
            velocity + self.slow_down
        } else {
            self.speed_up * (1.0 + velocity / self.slow_down)
        }
    }

    /// The highest velocity from which the hardest slow-down ends before a position limit.
    fn room(&self, distance: f64) -> f64 {
        fastest(distance.max(0.0), self.slow_down)
    }
}

/// `f64::clamp` panics where this does not: on limits that are no numbers or in the wrong order.
fn within(value: f64, lowest: f64, highest: f64) -> f64 {
    value.max(lowest).min(highest)
}

/// The highest velocity, counts per tick, from which a slow-down by `step` a tick ends within
/// `distance`, this tick included: `u(e)` above.
fn fastest(distance: f64, step: f64) -> f64 {
    let ticks = (((1.0 + 8.0 * distance / step).sqrt() - 1.0) / 2.0).floor();
    distance / (ticks + 1.0) + step * ticks / 2.0
}

#[cfg(test)]
mod tests;
