//! The age of a message, without trust in the clock of its sender.
//!
//! A message that was sent at `sent` by its sender's clock and arrived at `arrived` by ours was
//! some time in transit, so our clock leads the sender's by at most `arrived - sent`. The minimum
//! over all messages is the best estimate of the lead, and the excess of a message is its age. One
//! direction shows no more than this ([`SenderClock`]): a stamp can make a message older than its
//! arrival, never younger.
//!
//! [`Moment`] reads monotonic and wall clock together, at sending or arrival: a step of the wall
//! clock changes later stamps, but no age.

use i2ris::units::Nanos;
use i2ris::{clock, wall_clock};

/// The same instant on both clocks of this computer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moment {
    pub monotonic: Nanos,
    pub unix_ns: u64,
}

impl Moment {
    pub fn now() -> Self {
        Self { unix_ns: wall_clock::unix_time().0, monotonic: clock::now() }
    }

    /// Unix time of an instant that has passed.
    pub fn unix_ns_at(&self, monotonic: Nanos) -> u64 {
        self.unix_ns.saturating_sub(self.monotonic.duration_since(monotonic).0)
    }

    /// The instant of a past Unix time, at most `limit` ago; now for a future one.
    pub fn monotonic_at(&self, unix_ns: u64, limit: Nanos) -> Nanos {
        self.monotonic - Nanos(self.unix_ns.saturating_sub(unix_ns)).min(limit)
    }
}

/// Estimate of a sender's clock by its messages.
///
/// A lead is never forgotten: otherwise a constant delay would become normal after a while, and
/// late messages would not count as old. The smallest lead rises only at the rate of clock drift.
/// A clock that is set back makes all messages old, and the robot holds; its sender starts again.
#[derive(Debug, Clone, Copy, Default)]
pub struct SenderClock {
    /// Smallest lead of our clock, ns, and the arrival up to which it includes drift.
    smallest: Option<(i64, Nanos)>,
}

impl SenderClock {
    /// The age of a message at its arrival: its delay relative to the quickest one.
    pub fn age(&mut self, sent_ns: u64, arrived: Nanos) -> Nanos {
        // Wraps for absurd stamps, which gives an absurd age.
        let lead = (arrived.0 as i64).wrapping_sub(sent_ns as i64);
        let known = self.smallest.map(|(known, at)| {
            let drift = (arrived.duration_since(at).0 as f64 * DRIFT) as i64;
            (known.saturating_add(drift), at.max(arrived))
        });
        let (smallest, at) = known.unwrap_or((lead, arrived));
        self.smallest = Some((smallest.min(lead), at));
        Nanos(u64::try_from(lead.saturating_sub(smallest)).unwrap_or(0))
    }
}

/// Maximum difference between the rates of two clocks: ten times that of corrected quartz.
const DRIFT: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    /// The sender's clock is years ahead of our monotonic one.
    const THERE: u64 = 1_795_000_000_000_000_000;

    #[test]
    fn an_instant_keeps_its_distance_from_now_on_both_clocks() {
        let now = Moment { monotonic: Nanos(5_000), unix_ns: 1_000_000 };
        assert_eq!(now.unix_ns_at(Nanos(4_000)), 999_000);
        assert_eq!(now.unix_ns_at(Nanos(6_000)), 1_000_000);
        assert_eq!(now.monotonic_at(999_000, Nanos(2_000)), Nanos(4_000));
        assert_eq!(now.monotonic_at(1_000, Nanos(2_000)), Nanos(3_000));
        assert_eq!(now.monotonic_at(2_000_000, Nanos(2_000)), Nanos(5_000));
    }

    #[test]
    fn age_is_the_delay_relative_to_the_quickest() {
        let mut clock = SenderClock::default();
        let mut age = |sent_ms: u64, arrived_ms: u64| {
            let age = clock.age(THERE + sent_ms * MS, Nanos(arrived_ms * MS));
            (age.0 + MS / 2) / MS
        };
        assert_eq!(age(1000, 1005), 0, "the first message");
        assert_eq!(age(1010, 1012), 0, "the quickest so far");
        assert_eq!(age(1020, 1030), 8, "8 ms more than the quickest");
        assert_eq!(age(1030, 3030), 1996, "stored for two seconds");
        assert_eq!(age(9000, 3040), 0, "a clock that was set ahead");
        assert_eq!(age(3050, 3050), 5960, "and back: old");
        assert_eq!(age(30_000, 30_000), 5933, "for as long as clocks cannot have drifted so far");
        for sent in [0, u64::MAX, i64::MAX as u64, 1 << 63, THERE] {
            let _ = clock.age(sent, Nanos(5 * MS));
        }
    }

    #[test]
    fn a_delay_that_stays_or_grows_slowly_stays_an_age() {
        for (delay_ms, per_s_ms) in [(500, 0.0), (0, 2.4)] {
            let mut clock = SenderClock::default();
            let mut late = Nanos::ZERO;
            for sent_ms in (0..60_000).step_by(10) {
                let grown = per_s_ms * f64::from(sent_ms) / 1000.0;
                let delay = if sent_ms < 1000 { 0 } else { delay_ms + grown as u64 };
                let sent_ms = u64::from(sent_ms as u32);
                late = clock.age(THERE + sent_ms * MS, Nanos((sent_ms + delay) * MS));
            }
            let (delay, drift) = (delay_ms as f64 + 60.0 * per_s_ms, 60.0);
            let late_ms = late.as_seconds() * 1e3;
            assert!((delay - drift - 3.0..=delay).contains(&late_ms), "{late_ms} of {delay}");
        }
    }
}
