//! From the monotonic clock of the controller to the wall clock of ROS, and back.
//!
//! Both are read at the moment of sending or arrival, so a step of the wall clock moves the stamps
//! that come after it and no age.

use std::time::{SystemTime, UNIX_EPOCH};

use i2ris::clock;
use i2ris::units::Nanos;

/// The same instant on both clocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moment {
    /// Monotonic.
    pub monotonic: Nanos,
    /// Nanoseconds since the epoch.
    pub unix_ns: u64,
}

impl Moment {
    /// Now.
    #[must_use]
    pub fn now() -> Self {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH);
        Self { monotonic: clock::now(), unix_ns: unix.map_or(0, |since| since.as_nanos() as u64) }
    }

    /// Unix time of an instant that has passed.
    #[must_use]
    pub fn unix_ns_at(&self, monotonic: Nanos) -> u64 {
        self.unix_ns.saturating_sub(self.monotonic.since(monotonic).0)
    }

    /// The instant of a Unix time that has passed, at most `limit` ago. Now for times to come: a
    /// stamp can make nothing younger than that.
    #[must_use]
    pub fn monotonic_at(&self, unix_ns: u64, limit: Nanos) -> Nanos {
        let ago = Nanos(self.unix_ns.saturating_sub(unix_ns)).min(limit);
        self.monotonic - ago
    }
}

/// Stamps that rise with every message, also when the wall clock is set back. CRTK's client ignores
/// an operating state that is not newer than the last one.
#[derive(Debug, Default)]
pub struct RisingStamps {
    last_unix_ns: u64,
}

impl RisingStamps {
    /// The stamp of the next message.
    pub fn next(&mut self, now_unix_ns: u64) -> u64 {
        self.last_unix_ns = now_unix_ns.max(self.last_unix_ns + 1);
        self.last_unix_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_rise_also_when_the_clock_is_set_back() {
        let mut stamps = RisingStamps::default();
        let found = [100, 100, 40, 41, 200].map(|now| stamps.next(now));
        assert_eq!(found, [100, 101, 102, 103, 200]);
    }

    #[test]
    fn an_instant_keeps_its_distance_from_now_on_both_clocks() {
        let now = Moment { monotonic: Nanos(5_000), unix_ns: 1_000_000 };
        assert_eq!(now.unix_ns_at(Nanos(4_000)), 999_000);
        assert_eq!(now.unix_ns_at(Nanos(6_000)), 1_000_000);
        assert_eq!(now.monotonic_at(999_000, Nanos(2_000)), Nanos(4_000));
        assert_eq!(now.monotonic_at(1_000, Nanos(2_000)), Nanos(3_000));
        assert_eq!(now.monotonic_at(2_000_000, Nanos(2_000)), Nanos(5_000));
    }
}
