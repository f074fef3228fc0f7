//! Over-current: motor current too high for too long.

use serde::{Deserialize, Serialize};

use crate::core::faults::debounce::Debounce;
use crate::drive::AxisFeedback;
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

    /// Updates the monitor. A reading counts only if the drive follows setpoints since before it.
    /// The time between readings counts, not the loop's: a single high one may precede a late line.
    pub(crate) fn update(&mut self, feedback: &AxisFeedback, following_since: Option<Nanos>) {
        let (current, read) = (feedback.current_ma.unsigned_abs(), feedback.current_stamp);
        let is_high = self.limit_ma.is_some_and(|limit| current > limit);
        let counts = following_since.is_some_and(|since| read >= since);
        self.is_tripped = self.debounce.update(counts && is_high, read);
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
    fn over_current_trips_only_by_readings_while_following() {
        let mut monitor = OverCurrentMonitor::new(Some(200), Nanos::from_millis(50));
        for (ms, current_ma, since, is_tripped) in [
            (0, -201, Some(0), false),
            (49, 201, Some(0), false),
            (50, 201, Some(0), true),
            (51, 200, Some(0), false),
            (60, 500, Some(0), false),
            // The line is late with the next reading.
            (60, 500, Some(0), false),
            (109, 500, Some(0), false),
            (110, 500, None, false),
            (110, 500, Some(120), false),
            (170, 500, Some(120), false),
            (220, 500, Some(120), true),
        ] {
            let current_stamp = Nanos::from_millis(ms);
            let feedback = AxisFeedback { current_ma, current_stamp, ..AxisFeedback::default() };
            monitor.update(&feedback, since.map(Nanos::from_millis));
            assert_eq!(monitor.is_tripped, is_tripped, "{ms} ms");
        }
    }
}
