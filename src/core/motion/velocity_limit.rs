//! Velocity, acceleration and jerk limits on the setpoint of one motor.
//!
//! # Terms
//!
//! - **setpoint**: commanded position of the motor in this tick, in fractional counts.
//! - **acceleration, deceleration**: change of the velocity away from zero, towards zero.
//!
//! # Guarantees
//!
//! With limits V (velocity), A (acceleration), D (deceleration, D >= A), tick T, for any targets:
//!
//! - the setpoint moves by at most `V T` per tick;
//! - its velocity grows by at most `A T` per tick and shrinks by at most `D T`. In a tick in which
//!   the velocity crosses zero, the deceleration comes first, and the rest of the tick is left for
//!   the acceleration;
//! - it never leaves the position limits. A setpoint that starts outside never goes further out;
//! - a fixed target is reached without overshoot if the limits allow it. A setpoint that moves too
//!   fast towards a target that has just changed slows down with D and comes back.
//!
//! The reference is the previous setpoint, not the measurement: the drive gives no feedback here.
//!
//! # Method
//!
//! Braking is planned with A, exactly for discrete ticks. From velocity `u`, lowered by `w = A T`
//! per tick, the setpoint travels, this tick included, `T ((n + 1) u - w n (n + 1) / 2)` with
//! `n = floor(u / w)`. The greatest `u` for a distance `e` is therefore, with `n` the largest
//! integer such that `w n (n + 1) / 2 <= e / T`,
//!
//! ```text
//! u(e) = e / (T (n + 1)) + w n / 2,    n = floor((sqrt(1 + 8 e / (w T)) - 1) / 2)
//! ```
//!
//! It ends on the target to the last digit, in the fewest ticks. This is the discrete form of
//! `u = sqrt(2 A e)`.
//!
//! The target may move. Braking is planned in the frame of the target: the wanted velocity is that
//! of the target plus `u` of the distance that is left after the target has moved. **A target that
//! moves within the limits is followed without lag.** Braking towards zero instead would make the
//! setpoint lag by `v^2 / 2A`: 3.7 counts, or 7 ms, at 12 deg/s.
//!
//! Deceleration above A, up to D, is reserved for what could not be planned: the target stops,
//! reverses, or comes near a position limit.

use serde::{Deserialize, Serialize};

use crate::units::{MAX_MOTORS, MAX_WINDOW_TICKS, MotorVec, Nanos};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorLimits {
    /// Largest velocity, counts per second, above 0.
    pub velocity: f64,
    /// Largest acceleration, counts per second squared, above 0.
    pub acceleration: f64,
    /// Largest deceleration, counts per second squared, not below `acceleration`.
    pub deceleration: f64,
    /// Lowest position, counts.
    pub lowest: f64,
    /// Highest position, counts.
    pub highest: f64,
}

/// Position that a motor is to reach in this tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotorTarget {
    /// Position, counts.
    pub position: f64,
    /// Change of `position` since the last tick, counts; 0 if it jumped.
    pub increment: f64,
}

impl MotorTarget {
    /// A target that does not move.
    pub fn fixed(position: f64) -> Self {
        Self { position, increment: 0.0 }
    }

    pub(crate) fn from_vectors(positions: &MotorVec, increments: &MotorVec) -> [Self; MAX_MOTORS] {
        let mut targets = [Self::default(); MAX_MOTORS];
        for ((target, position), increment) in targets.iter_mut().zip(positions).zip(increments) {
            *target = Self { position: *position, increment: *increment };
        }
        targets
    }
}

/// Moves the setpoint of one motor within its [`MotorLimits`], one step per tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VelocityLimiter {
    /// Counts per tick.
    velocity_limit: f64,
    /// Counts per tick squared.
    acceleration: f64,
    /// Counts per tick squared.
    deceleration: f64,
    lowest: f64,
    highest: f64,
    position: f64,
    /// Counts per tick.
    velocity: f64,
}

impl VelocityLimiter {
    /// A limiter for ticks of length `period`, at rest at 0.
    pub fn new(limits: &MotorLimits, period: Nanos) -> Self {
        let tick = period.as_seconds();
        // A limit so small that it vanishes would make 0 * infinity below.
        let acceleration = (limits.acceleration * tick * tick).max(f64::MIN_POSITIVE);
        Self {
            velocity_limit: limits.velocity * tick,
            acceleration,
            deceleration: (limits.deceleration * tick * tick).max(acceleration),
            lowest: limits.lowest,
            highest: limits.highest,
            position: 0.0,
            velocity: 0.0,
        }
    }

    /// The setpoint, counts.
    pub fn position(&self) -> f64 {
        self.position
    }

    /// Change of the setpoint in the last tick, counts.
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// The setpoint has no velocity.
    pub fn is_at_rest(&self) -> bool {
        self.velocity == 0.0
    }

    /// Starts again at rest at a position, which may be outside the limits.
    pub fn restart(&mut self, position: f64) {
        self.position = position;
        self.velocity = 0.0;
    }

    /// Moves one tick towards a target. Stops if the target is not a number.
    pub fn track(&mut self, target: MotorTarget) {
        self.advance(self.velocity_towards(target));
    }

    /// Like [`VelocityLimiter::track`], but with a velocity between that of a stop (0) and that
    /// towards the target (1).
    pub(crate) fn track_part(&mut self, target: MotorTarget, share: f64) {
        let (whole, stop) = (self.velocity_towards(target), self.next_velocity(0.0));
        self.advance(if share < 1.0 { stop + share.max(0.0) * (whole - stop) } else { whole });
    }

    /// Slows down for one tick as hard as allowed.
    pub fn stop(&mut self) {
        self.advance(self.next_velocity(0.0));
    }

    /// Where the setpoint comes to rest when it stops from now on, counts.
    pub(crate) fn rest_position(&self) -> f64 {
        let (speed, step) = (self.velocity.abs(), self.deceleration);
        let ticks = (speed / step).floor();
        let distance = ticks * speed - step * ticks * (ticks + 1.0) / 2.0;
        self.position + distance.copysign(self.velocity)
    }

    /// Ticks until then.
    pub fn ticks_to_rest(&self) -> f64 {
        (self.velocity.abs() / self.deceleration).ceil()
    }

    /// The velocity of the next tick towards a target, counts per tick.
    pub(crate) fn velocity_towards(&self, target: MotorTarget) -> f64 {
        if target.position.is_nan() || !target.increment.is_finite() {
            return self.next_velocity(0.0);
        }
        let position = clamp(target.position, self.lowest, self.highest);
        let gap = position - target.increment - self.position;
        let braking = braking_velocity(gap.abs(), self.acceleration).copysign(gap);
        self.next_velocity(target.increment + braking)
    }

    /// The velocity nearest to a wanted one that may come next.
    pub(crate) fn next_velocity(&self, wanted: f64) -> f64 {
        let reachable = clamp(
            wanted,
            -self.max_next_velocity(-self.velocity),
            self.max_next_velocity(self.velocity),
        );
        let limited = clamp(reachable, -self.velocity_limit, self.velocity_limit);
        let (down, up) = (
            self.stop_velocity(self.position - self.lowest),
            self.stop_velocity(self.highest - self.position),
        );
        clamp(limited, -down, up)
    }

    fn advance(&mut self, velocity: f64) {
        self.velocity = velocity;
        self.position += velocity;
    }

    /// The largest step of a tick and its largest change, counts.
    pub(crate) fn largest_steps(&self) -> [f64; 2] {
        [self.velocity_limit, self.deceleration]
    }

    fn max_next_velocity(&self, velocity: f64) -> f64 {
        if velocity >= 0.0 {
            velocity + self.acceleration
        } else if velocity <= -self.deceleration {
            velocity + self.deceleration
        } else {
            self.acceleration * (1.0 + velocity / self.deceleration)
        }
    }

    /// The highest velocity from which the hardest braking ends before a position limit.
    fn stop_velocity(&self, distance: f64) -> f64 {
        braking_velocity(distance.max(0.0), self.deceleration)
    }
}

/// Unlike `f64::clamp`, does not panic on limits that are not numbers or in the wrong order.
fn clamp(value: f64, lowest: f64, highest: f64) -> f64 {
    value.max(lowest).min(highest)
}

/// The highest velocity, counts per tick, from which braking by `step` per tick ends within
/// `distance`, this tick included: `u(e)` above.
fn braking_velocity(distance: f64, step: f64) -> f64 {
    let ticks = (((1.0 + 8.0 * distance / step).sqrt() - 1.0) / 2.0).floor();
    distance / (ticks + 1.0) + step * ticks / 2.0
}

/// Jerk limit: a moving average over the last ticks.
///
/// The input has a limited acceleration. In the average over `n` ticks of length `T`, the
/// acceleration changes per tick by the difference of two accelerations over `n`. With
/// accelerations between `-A` and `A`, the jerk is at most `2 A / (n T)` (L. Biagiotti and
/// C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008: trajectories by
/// filters). The average keeps the limits on position, velocity and acceleration of its input. It
/// lags by `(n - 1) / 2` ticks and comes to rest `n - 1` ticks after its input.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct JerkLimiter {
    /// The newest value is at `ticks % window`.
    past: [f64; MAX_WINDOW_TICKS],
    ticks: u32,
    /// Ticks; with 1, the output is the input.
    window: u32,
    pub output: f64,
    pub increment: f64,
}

impl JerkLimiter {
    /// At rest at 0. The window is clamped to 1 to [`MAX_WINDOW_TICKS`].
    pub(super) fn new(window: u32) -> Self {
        let window = window.clamp(1, MAX_WINDOW_TICKS as u32);
        Self { past: [0.0; MAX_WINDOW_TICKS], ticks: 0, window, output: 0.0, increment: 0.0 }
    }

    pub(super) fn restart(&mut self, value: f64) {
        self.past = [value; MAX_WINDOW_TICKS];
        (self.output, self.increment) = (value, 0.0);
    }

    pub(super) fn update(&mut self, value: f64) {
        self.ticks = (self.ticks + 1) % self.window;
        if let Some(newest) = self.past.get_mut(self.ticks as usize) {
            *newest = value;
        }
        // Relative to the newest value, so that the average of equal values is exact.
        let others: f64 = self.values().map(|past| past - value).sum();
        let output = value + others / f64::from(self.window);
        self.increment = output - self.output;
        self.output = output;
    }

    /// All values in the window are the same, and the output has reached them.
    pub(super) fn is_at_rest(&self) -> bool {
        self.increment == 0.0 && self.values().all(|past| *past == self.output)
    }

    /// All values in the window are less than a count from the output.
    pub(crate) fn is_settled(&self) -> bool {
        self.values().all(|past| (past - self.output).abs() < 1.0)
    }

    fn values(&self) -> impl Iterator<Item = &f64> {
        self.past.iter().take(self.window as usize)
    }
}

#[cfg(test)]
mod tests;
