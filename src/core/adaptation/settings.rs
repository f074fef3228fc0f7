//! Settings of the adaptation, from the configuration, in SI units.

use super::Pair;
use crate::config::AdaptationConfig;
use crate::units::Nanos;

/// Settings that do not change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::core) struct Settings {
    /// rad.
    pub zero_budget: f64,
    pub gain_budget: f64,
    pub gap_budget: f64,
    pub latency_budget_s: f64,
    /// rad.
    pub total_budget: f64,
    /// rad/s.
    pub slew: f64,
    /// Deviation of the camera, rad.
    pub camera: f64,
    /// rad.
    pub largest_step: f64,
    pub least_quality: f64,
    pub tick_s: f64,
}

impl Settings {
    pub fn new(config: &AdaptationConfig, tick: Nanos) -> Self {
        Self {
            zero_budget: config.zero_budget_deg.to_radians(),
            gain_budget: config.gain_budget,
            gap_budget: config.gap_budget,
            latency_budget_s: 1e-3 * config.latency_budget_ms,
            total_budget: config.total_budget_deg.to_radians(),
            slew: config.slew_deg_s.to_radians(),
            camera: config.camera_deviation_deg.to_radians(),
            largest_step: config.largest_step_deg.to_radians(),
            least_quality: config.least_quality,
            tick_s: tick.as_seconds(),
        }
    }
}

/// Length of a vector.
pub(super) fn length([x, y]: Pair) -> f64 {
    x.hypot(y)
}
