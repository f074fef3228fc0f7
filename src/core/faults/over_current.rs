//! Over-current: motor current too high for too long.

use serde::{Deserialize, Serialize};

use crate::core::faults::debounce::Debounce;
use crate::robot::{Measurement, Quantity};
use crate::units::Nanos;

/// Current monitor of one motor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct OverCurrentMonitor {
    /// Absolute current, mA. `None`: not monitored.
    limit_ma: Option<u32>,
    debounce: Debounce,
    pub is_tripped: bool,
}

impl OverCurrentMonitor {
    pub(crate) fn new(limit_ma: Option<u32>, time: Nanos) -> Self {
        Self { limit_ma, debounce: Debounce::new(time), is_tripped: false }
    }

    /// Updates the monitor. The current counts only while the drive follows setpoints.
    pub(crate) fn update(&mut self, current_ma: i32, is_following: bool, now: Nanos) {
        let is_high = self.limit_ma.is_some_and(|limit| current_ma.unsigned_abs() > limit);
        self.is_tripped = self.debounce.update(is_following && is_high, now);
    }

    /// The present current and its limit, if the monitor has tripped.
    pub(crate) fn measurement(&self, current_ma: i32) -> Option<Measurement> {
        let limit = f64::from(self.limit_ma.filter(|_| self.is_tripped)?);
        let current = f64::from(current_ma.unsigned_abs());
        Some(Measurement::new(Quantity::Milliamperes, current, Some(limit)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn over_current_trips_only_while_following() {
        let mut monitor = OverCurrentMonitor::new(Some(200), Nanos::from_millis(50));
        for (ms, current_ma, is_following, is_tripped) in [
            (0, -201, true, false),
            (49, 201, true, false),
            (50, 201, true, true),
            (51, 200, true, false),
            (60, 500, true, false),
            (109, 500, true, false),
            (110, 500, false, false),
        ] {
            monitor.update(current_ma, is_following, Nanos::from_millis(1000 + ms));
            assert_eq!(monitor.is_tripped, is_tripped, "{ms} ms");
        }
    }
}
