//! How often to send. Without I/O.
//!
//! QUIC slows down where packets are lost, and keeps what cannot be sent yet in a queue of a
//! megabyte. With a twentieth of the packets lost over a tenth of a second there and back, streams
//! arrived seconds late. So the receiver reports by how much messages are later than the quickest
//! one, and the sender sends less often while they queue.

use i2ris::units::Nanos;

/// The longest time between two messages.
const SLOWEST: Nanos = Nanos::from_millis(200);
/// Where slowing down begins if there was no pause before.
const FIRST: Nanos = Nanos::from_millis(4);
/// Messages that are later than this queue somewhere.
const LATE: Nanos = Nanos::from_millis(50);
/// Messages that are no later than this do not.
const PROMPT: Nanos = Nanos::from_millis(20);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Pace {
    fastest: Nanos,
    period: Nanos,
    next: Nanos,
}

impl Pace {
    /// At most once in this time.
    pub fn new(fastest: Nanos) -> Self {
        Self { fastest, period: fastest, next: Nanos::ZERO }
    }

    /// Whether to send now.
    pub fn is_due(&mut self, now: Nanos) -> bool {
        let is_due = now >= self.next;
        if is_due {
            self.next = now + self.period;
        }
        is_due
    }

    /// Takes note of how much later than the quickest the newest messages arrived.
    pub fn note(&mut self, lag: Nanos) {
        if lag > LATE {
            let longer = self.period.0.max(FIRST.0) / 2 * 3;
            self.period = Nanos(longer).min(SLOWEST);
        } else if lag < PROMPT {
            self.period = Nanos(self.period.0 / 32 * 31).max(self.fastest);
        }
    }
}

/// The quickest message is forgotten after one to two of these: a delay that stays is the link's,
/// and no queue.
const WINDOW: Nanos = Nanos::from_millis(10_000);

/// How much later than the quickest messages arrive.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Lag {
    start: Nanos,
    /// Smallest delay, plus the distance of the clocks, in the window before and in this one, ns.
    quickest: [Option<i64>; 2],
    largest: Option<Nanos>,
}

impl Lag {
    /// A message of this time has arrived.
    pub fn note(&mut self, stamp_ns: u64, now: Nanos) {
        let delay = (now.0 as i64).wrapping_sub(stamp_ns as i64);
        let elapsed = now.since(self.start);
        if elapsed >= WINDOW {
            let recent = self.quickest[1].filter(|_| elapsed < WINDOW + WINDOW);
            self.quickest = [recent, None];
            self.start = now;
        }
        let known = self.quickest.into_iter().flatten().min();
        self.quickest[1] = Some(self.quickest[1].map_or(delay, |known| known.min(delay)));
        let more = known.map_or(0, |known| delay.saturating_sub(known));
        let lag = Nanos(u64::try_from(more).unwrap_or(0));
        self.largest = Some(self.largest.unwrap_or_default().max(lag));
    }

    /// The largest lag since the last call, us, at least 1; 0: nothing arrived.
    pub fn take_us(&mut self) -> u32 {
        let lag = self.largest.take();
        lag.map_or(0, |lag| u32::try_from(lag.0 / 1000).unwrap_or(u32::MAX).max(1))
    }
}

/// A lag as it is reported; `None`: nothing arrived.
pub(crate) fn lag_of_us(lag_us: u32) -> Option<Nanos> {
    (lag_us != 0).then(|| Nanos::from_micros(lag_us.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute on a link that carries one message in `capacity` and queues the rest; the largest
    /// time in the queue in the second half, and messages per second.
    fn run(capacity: Nanos) -> (Nanos, f64) {
        let mut pace = Pace::new(Nanos::from_millis(5));
        let (mut lag, mut free_at, mut worst) = (Lag::default(), Nanos::ZERO, Nanos::ZERO);
        let (half, mut sent) = (Nanos::from_millis(30_000), 0);
        for tick in 0..60_000 {
            let now = Nanos::from_millis(1000 + tick);
            if pace.is_due(now) {
                free_at = free_at.max(now) + capacity;
                lag.note(now.0, free_at);
                if now > half {
                    sent += 1;
                    worst = worst.max(free_at.since(now));
                }
            }
            if tick % 50 == 0
                && let Some(lag) = lag_of_us(lag.take_us())
            {
                pace.note(lag);
            }
        }
        (worst, f64::from(sent) / 31.0)
    }

    #[test]
    fn a_fast_link_is_used_at_the_full_rate() {
        let (worst, rate_hz) = run(Nanos::from_millis(1));
        assert!(worst < LATE && rate_hz > 190.0, "{worst:?} {rate_hz}");
    }

    #[test]
    fn on_a_slow_link_messages_are_fewer_and_not_late() {
        for capacity_ms in [10, 25, 50] {
            let (worst, rate_hz) = run(Nanos::from_millis(capacity_ms));
            assert!(worst < Nanos::from_millis(500), "{capacity_ms} {worst:?}");
            assert!(rate_hz > 0.3 * 1000.0 / capacity_ms as f64, "{rate_hz}");
        }
    }

    #[test]
    fn without_an_arrival_there_is_no_lag() {
        let mut lag = Lag::default();
        assert_eq!(lag_of_us(lag.take_us()), None);
        lag.note(0, Nanos::from_millis(70));
        assert_eq!(lag.take_us(), 1);
        lag.note(0, Nanos::from_millis(170));
        assert_eq!(lag.take_us(), 100_000);
        assert_eq!(lag.take_us(), 0);
    }
}
