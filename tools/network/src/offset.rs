//! The offset between the clocks of two computers. Without I/O.
//!
//! An exchange gives two bounds. The client asks at `sent`, the server answers with its own time
//! `there`, the answer arrives at `arrived`; `sent` and `arrived` are of the client's clock. The
//! server's clock showed `there` somewhere between them, so its offset from the client's lies
//! between `there - arrived` and `there - sent`, whatever the transit took (F. Cristian,
//! "Probabilistic clock synchronization", 1989). The best bounds of all exchanges are kept, so they
//! are as far apart as the smallest round trip. Both widen with time, because clocks do not run
//! equally fast.

use i2ris::units::Nanos;

/// Bound of the difference of the rates of two clocks: ten times what quartz and its correction by
/// the network amount to.
const DRIFT: f64 = 1e-3;

/// The server's clock minus the client's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ClockOffset {
    bounds: Option<Bounds>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Bounds {
    least: i64,
    most: i64,
    at: Nanos,
}

impl ClockOffset {
    /// Takes note of an exchange; one that cannot have been is ignored.
    pub fn note(&mut self, sent: Nanos, there: Nanos, arrived: Nanos) {
        if arrived < sent {
            return;
        }
        let [sent, there, at] = [sent.0, there.0, arrived.0].map(|time| time as i64);
        let (least, most) = (there.wrapping_sub(at), there.wrapping_sub(sent));
        let new = Bounds { least, most, at: arrived };
        let known = self.bounds.map(|bounds| bounds.widened(arrived));
        self.bounds = Some(match known {
            // Bounds that exclude each other: one clock has jumped, for instance at a suspend.
            Some(known) if known.least > most || known.most < least => new,
            Some(known) => {
                Bounds { least: known.least.max(least), most: known.most.min(most), at: arrived }
            }
            None => new,
        });
    }

    /// A moment of the client's clock on the server's, never later than it was: the age that the
    /// server counts is never too small. 0 stays 0: it never was.
    #[must_use]
    pub fn there(&self, stamp: u64, now: Nanos) -> Option<u64> {
        let least = self.bounds?.widened(now).least;
        Some(shifted(stamp, least))
    }

    /// A moment of the server's clock on the client's, never later than it was. 0 stays 0.
    #[must_use]
    pub fn here(&self, stamp: u64, now: Nanos) -> Option<u64> {
        let most = self.bounds?.widened(now).most;
        Some(shifted(stamp, most.wrapping_neg()).min(now.0))
    }

    /// The distance of the bounds: the smallest round trip, a little more if it is old.
    #[must_use]
    pub fn uncertainty(&self, now: Nanos) -> Option<Nanos> {
        let bounds = self.bounds?.widened(now);
        Some(Nanos(bounds.most.abs_diff(bounds.least)))
    }
}

impl Bounds {
    fn widened(self, now: Nanos) -> Self {
        let drift = (now.since(self.at).0 as f64 * DRIFT).ceil() as i64;
        Self {
            least: self.least.wrapping_sub(drift),
            most: self.most.wrapping_add(drift),
            at: self.at.max(now),
        }
    }
}

fn shifted(stamp: u64, by: i64) -> u64 {
    if stamp == 0 { 0 } else { stamp.saturating_add_signed(by).max(1) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const DAY: u64 = 86_400_000_000_000;

    /// Two clocks: the server's is `lead` ahead at `start` and runs faster by `rate`.
    fn server(client: u64, lead: i64, rate: f64) -> u64 {
        (client + ((client - DAY) as f64 * rate) as u64).saturating_add_signed(lead)
    }

    #[test]
    fn the_bounds_are_those_of_the_smallest_round_trip() {
        let mut offset = ClockOffset::default();
        assert_eq!(offset.there(5, Nanos(5)), None);
        let ms = |time: u64| Nanos::from_millis(time);
        offset.note(ms(1000), ms(5010), ms(1080));
        assert_eq!(offset.uncertainty(ms(1080)), Some(ms(80)));
        offset.note(ms(1100), ms(5105), ms(1110));
        assert!(offset.uncertainty(ms(1110)).unwrap() <= ms(10));
        offset.note(ms(1200), ms(5290), ms(1400));
        let uncertainty = offset.uncertainty(ms(1400)).unwrap();
        assert!(uncertainty < ms(11), "a slow one adds nothing: {uncertainty:?}");
        let age = ms(1400 + 4000).0 - offset.there(ms(1400).0, ms(1400)).unwrap();
        assert!(age <= ms(11).0);
        assert_eq!(offset.there(0, ms(1400)), Some(0));
        assert_eq!(offset.here(0, ms(1400)), Some(0));
    }

    #[test]
    fn a_clock_that_jumps_is_noticed() {
        let mut offset = ClockOffset::default();
        let ms = |time: u64| Nanos::from_millis(time);
        offset.note(ms(1000), ms(5000), ms(1001));
        offset.note(ms(2000), ms(90_000), ms(2002));
        assert_eq!(offset.uncertainty(ms(2002)), Some(ms(2)));
    }

    proptest! {
        /// Whatever the clocks show and the transit takes, no stamp becomes younger, in neither
        /// direction, and none older by more than the smallest round trip and the drift.
        #[test]
        fn no_stamp_becomes_younger(
            lead in -(1_i64 << 45)..1 << 45,
            rate in -2e-4..2e-4,
            exchanges in prop::collection::vec(
                (0_u64..1 << 33, 0_u64..1 << 31, 0_u64..1 << 31), 1..20
            ),
            later in 0_u64..1 << 34,
        ) {
            let mut offset = ClockOffset::default();
            let (mut now, mut smallest) = (DAY, u64::MAX);
            for (wait, transit_there, transit_back) in exchanges {
                let sent = now + wait;
                let there = server(sent + transit_there, lead, rate);
                now = sent + transit_there + transit_back;
                smallest = smallest.min(transit_there + transit_back);
                offset.note(Nanos(sent), Nanos(there), Nanos(now));
            }
            let moment = now + later;
            let there = server(moment, lead, rate);
            let counted = offset.there(moment, Nanos(moment)).unwrap();
            prop_assert!(counted <= there + 1);
            let shown = offset.here(there, Nanos(moment)).unwrap();
            prop_assert!(shown <= moment);
            let slack = smallest + ((moment - DAY) as f64 * 2.0 * DRIFT) as u64 + 10;
            prop_assert!(there - counted.min(there) <= slack);
            prop_assert!(moment - shown <= slack);
        }
    }
}
