//! Message rate of a client.

use i2ris::units::Nanos;

use super::Reason;

/// Maximum message rate of one client, 1/s: twice the rate of the loop.
pub(super) const PER_SECOND: u32 = 2000;

/// Long enough for a client that catches up after a stall of the machine.
const WINDOW: Nanos = Nanos::from_millis(1000);

/// The messages of one client.
#[derive(Debug, Default)]
pub(super) struct Flood {
    start: Nanos,
    count: u32,
    /// Whether the previous window had too many.
    flooding: bool,
}

impl Flood {
    /// Counts messages. Refuses too many in this window or in the previous one: a client that
    /// floods never gets through.
    pub fn check(&mut self, count: u32, now: Nanos) -> Result<(), Reason> {
        let elapsed = now.duration_since(self.start);
        if elapsed >= WINDOW {
            self.flooding = self.count > PER_SECOND && elapsed < WINDOW + WINDOW;
            (self.start, self.count) = (now, 0);
        }
        self.count = self.count.saturating_add(count);
        if self.flooding || self.count > PER_SECOND {
            return Err(Reason::Flood { per_second: PER_SECOND });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share_taken(per_second: u64, seconds: u64) -> f64 {
        let (mut flood, total) = (Flood::default(), per_second * seconds);
        let at = |place: u64| Nanos(1 + place * 1_000_000_000 / per_second);
        let taken = (0..total).filter(|place| flood.check(1, at(*place)).is_ok());
        taken.count() as f64 / total as f64
    }

    #[test]
    fn a_thousand_messages_a_second_pass_and_a_flood_ends() {
        assert_eq!(share_taken(1000, 3), 1.0);
        // 2000 in the first second, and nothing after that.
        assert!(share_taken(10_000, 3) < 0.07);
    }

    #[test]
    fn client_that_stops_flooding_passes_again() {
        let mut flood = Flood::default();
        let ms = |ms: u64| Nanos::from_millis(1000 + ms);
        assert!(flood.check(5000, ms(0)).is_err());
        assert!(flood.check(1, ms(1100)).is_err(), "the previous window");
        assert!(flood.check(1, ms(2200)).is_ok());
    }
}
