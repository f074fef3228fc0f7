//! Soft starts and stops, shared by everything that moves the snake along a trajectory. Pure.

/// Time in which a motion comes to rest, and comes up to speed where nothing asks for longer, s.
pub const RAMP_S: f64 = 0.3;

/// Longest step of time, s. A program that was delayed continues where it was; it does not jump
/// ahead.
pub const LONGEST_STEP_S: f64 = 0.02;

/// Time along a trajectory. It runs at a rate between 0 and 1, which rises at the start and falls
/// before the end: the shape of the trajectory does not change, only its speed.
#[derive(Debug, Clone)]
pub struct TrajectoryTime {
    /// Time along the trajectory, s.
    pub time_s: f64,
    /// Seconds of trajectory per second.
    pub rate: f64,
}

impl TrajectoryTime {
    /// Advances by `step_s` seconds, and comes up to speed in `start_s`; `stop` asks to come to
    /// rest.
    pub fn advance(&mut self, step_s: f64, stop: bool, start_s: f64) {
        let step_s = step_s.clamp(0.0, LONGEST_STEP_S);
        let ramp = if stop { -step_s / RAMP_S } else { step_s / start_s };
        self.rate = (self.rate + ramp).clamp(0.0, 1.0);
        self.time_s += self.rate * step_s;
    }
}

/// From 0 to 1 with rest at both ends: the minimum-jerk polynomial of Flash and Hogan (1985),
/// s^3 (10 - 15 s + 6 s^2).
pub fn minimum_jerk(share: f64) -> f64 {
    let s = share.clamp(0.0, 1.0);
    s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
}
