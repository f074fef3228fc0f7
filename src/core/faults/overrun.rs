//! Overrun monitor: too many late ticks within a window.

use serde::{Deserialize, Serialize};

use crate::robot::{Measurement, Quantity};
use crate::units::Nanos;

/// Leaky bucket as a meter (J. S. Turner 1986). It is full after a number of overruns within a
/// window, and never at a steady rate below that. It keeps no list of times, so its size does not
/// depend on the window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct OverrunMonitor {
    limit: f64,
    /// Overruns per nanosecond.
    leak: f64,
    level: f64,
    last: Nanos,
}

impl OverrunMonitor {
    /// Full after `limit` overruns within a second; never, if `limit` is 0.
    pub(crate) fn new(limit: u32) -> Self {
        let limit = f64::from(limit);
        Self { limit, leak: limit / 1e9, level: 0.0, last: Nanos::ZERO }
    }

    /// Adds overruns. Returns whether the bucket is full.
    pub(crate) fn add(&mut self, overruns: u32, now: Nanos) -> bool {
        let leaked = now.duration_since(self.last).0 as f64 * self.leak;
        self.level = (self.level - leaked).max(0.0) + f64::from(overruns);
        self.last = now;
        self.limit > 0.0 && self.level >= self.limit
    }

    /// Late ticks in the bucket, and its capacity.
    pub(crate) fn measurement(&self) -> Measurement {
        Measurement::new(Quantity::LateTicks, self.level, Some(self.limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Nanos {
        Nanos::from_millis(10_000 + milliseconds)
    }

    #[test]
    fn burst_is_an_overrun_but_low_rate_is_not() {
        let mut monitor = OverrunMonitor::new(10);
        assert!((0..9).all(|k| !monitor.add(1, ms(k))));
        assert!(monitor.add(2, ms(9)));
        // Nine per second, for ten seconds, once the bucket is empty again.
        assert!((0..90).all(|k| !monitor.add(1, ms(2000 + k * 112))));
        assert!(OverrunMonitor::new(10).add(10, ms(0)), "all at once");
        let mut never = OverrunMonitor::new(0);
        assert!((0..1000).all(|k| !never.add(9, ms(k))));
    }
}
