//! The age of a message, without trust in the sender's clock.
//!
//! The offset between the arrival, on our monotonic clock, and the stamp, on the sender's wall
//! clock, is the difference of the clocks plus the time in transit. The smallest offset seen is the
//! best estimate of the difference; what a message has more than it is its age. So a stamp can make
//! a message older than its arrival, never younger.

use i2ris::units::Nanos;

/// An offset is forgotten after one to two of these: clocks drift, and may be set. A clock that was
/// set back makes messages old until then, and the robot holds.
const WINDOW: Nanos = Nanos::from_millis(10_000);

/// What is known of a sender's clock.
#[derive(Debug, Default)]
pub(super) struct SenderClock {
    start: Nanos,
    /// Smallest offset in the window before and in this one, ns.
    smallest: [Option<i64>; 2],
}

impl SenderClock {
    /// The age of a message at its arrival.
    pub fn age(&mut self, sent_unix_ns: u64, arrived: Nanos) -> Nanos {
        // Wraps for absurd stamps, which gives an absurd age.
        let offset = (arrived.0 as i64).wrapping_sub(sent_unix_ns as i64);
        let elapsed = arrived.since(self.start);
        if elapsed >= WINDOW {
            let recent = self.smallest[1].filter(|_| elapsed < WINDOW + WINDOW);
            self.smallest = [recent, None];
            self.start = arrived;
        }
        let known = self.smallest.into_iter().flatten().min();
        self.smallest[1] = Some(self.smallest[1].map_or(offset, |known| known.min(offset)));
        let more = known.map_or(0, |known| offset.saturating_sub(known));
        Nanos(u64::try_from(more).unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    /// The sender's clock is years ahead of our monotonic one.
    const THERE: u64 = 1_795_000_000_000_000_000;

    #[test]
    fn the_age_is_what_a_message_took_longer_than_the_fastest() {
        let mut clock = SenderClock::default();
        let mut age = |sent_ms: u64, arrived_ms: u64| {
            clock.age(THERE + sent_ms * MS, Nanos(arrived_ms * MS)).0 / MS
        };
        assert_eq!(age(1000, 1005), 0, "nothing is known yet");
        assert_eq!(age(1010, 1012), 0, "the fastest so far");
        assert_eq!(age(1020, 1030), 8, "8 ms more than the fastest");
        assert_eq!(age(1030, 3030), 1998, "kept for two seconds");
        assert_eq!(age(9000, 3040), 0, "a clock that was set ahead");
        assert_eq!(age(3050, 3050), 5960, "and back: old");
        assert_eq!(age(30_000, 30_000), 0, "until that is forgotten");
    }

    #[test]
    fn absurd_stamps_do_not_panic() {
        let mut clock = SenderClock::default();
        for sent in [0, u64::MAX, i64::MAX as u64, 1 << 63, THERE] {
            let _ = clock.age(sent, Nanos(5 * MS));
        }
    }
}
