//! Soft starts and stops, shared by all motions of the snake along a trajectory. Pure.

/// Minimum duration of a start, and duration of a stop, s.
pub const RAMP_S: f64 = 0.3;

/// Maximum time step, s. A delayed program continues where it was; it does not jump ahead.
pub const MAX_STEP_S: f64 = 0.02;

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
    /// Advances by `step_s` seconds, and reaches full speed in `start_s`; `stop` requests a stop.
    pub fn advance(&mut self, step_s: f64, stop: bool, start_s: f64) {
        let step_s = step_s.clamp(0.0, MAX_STEP_S);
        let ramp = if stop { -step_s / RAMP_S } else { step_s / start_s };
        self.rate = (self.rate + ramp).clamp(0.0, 1.0);
        self.time_s += self.rate * step_s;
    }
}

/// The minimum-jerk polynomial of Flash and Hogan (1985), from 0 to 1: s^3 (10 - 15 s + 6 s^2).
pub fn minimum_jerk(share: f64) -> f64 {
    let s = share.clamp(0.0, 1.0);
    s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
}
