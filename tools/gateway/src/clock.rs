//! The age of what another computer sent, without trust in its clock.
//!
//! A message that was sent at `sent` by its sender's clock and arrived at `arrived` by ours was
//! some time in transit, so our clock leads the sender's by at most `arrived - sent`. The smallest
//! such number of all messages is the best estimate of the lead, and what another message has more
//! than it is its age. This is all that one direction tells ([`SenderClock`]): a stamp can make a
//! message older than its arrival, never younger.
//!
//! A question and its answer are a message in each direction, which bounds the lead from both sides
//! whatever the transit took (F. Cristian, "Probabilistic clock synchronization", 1989). So a stamp
//! can be put on the other clock without becoming younger ([`ClockOffset`]).
//!
//! [`Moment`] reads monotonic and wall clock together, at sending or arrival: a step of the wall
//! clock moves the stamps that come after it and no age.

use std::time::{SystemTime, UNIX_EPOCH};

use i2ris::clock;
use i2ris::units::Nanos;

/// The same instant on both clocks of this computer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moment {
    pub monotonic: Nanos,
    /// Nanoseconds since the epoch.
    pub unix_ns: u64,
}

impl Moment {
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
        self.monotonic - Nanos(self.unix_ns.saturating_sub(unix_ns)).min(limit)
    }
}

/// What the messages of one sender tell of its clock.
///
/// A lead is never forgotten: a delay that stays would be the usual one after a while, and every
/// message late without being old. The smallest lead only rises as fast as clocks may drift apart.
/// A clock that is set back makes all messages old, and the robot holds; its sender starts again.
#[derive(Debug, Clone, Copy, Default)]
pub struct SenderClock {
    /// Smallest lead of our clock, ns, and the arrival up to which drift is in it.
    smallest: Option<(i64, Nanos)>,
}

impl SenderClock {
    /// The age of a message at its arrival: how much later it came than the quickest one.
    pub fn age(&mut self, sent_ns: u64, arrived: Nanos) -> Nanos {
        // Wraps for absurd stamps, which gives an absurd age.
        let lead = (arrived.0 as i64).wrapping_sub(sent_ns as i64);
        let known = self.smallest.map(|(known, at)| {
            let drift = (arrived.since(at).0 as f64 * DRIFT) as i64;
            (known.saturating_add(drift), at.max(arrived))
        });
        let (smallest, at) = known.unwrap_or((lead, arrived));
        self.smallest = Some((smallest.min(lead), at));
        Nanos(u64::try_from(lead.saturating_sub(smallest)).unwrap_or(0))
    }
}

/// Bound of the difference of the rates of two clocks: ten times what quartz and its correction by
/// the network amount to.
const DRIFT: f64 = 1e-3;

/// The server's clock minus the client's, between the best bounds of all exchanges: they are as far
/// apart as the smallest round trip. Both widen with time, because clocks do not run equally fast.
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
    /// Takes note of an exchange: asked at `sent`, answered with the server's `there`, `arrived`
    /// here. One that cannot have been is ignored.
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
        Some(shifted(stamp, self.bounds?.widened(now).least))
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

    const MS: u64 = 1_000_000;
    const DAY: u64 = 86_400_000 * MS;
    /// The sender's clock is years ahead of our monotonic one.
    const THERE: u64 = 1_795_000_000_000_000_000;

    fn ms(time: u64) -> Nanos {
        Nanos::from_millis(time)
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

    #[test]
    fn the_age_is_what_a_message_took_longer_than_the_quickest() {
        let mut clock = SenderClock::default();
        let mut age = |sent_ms: u64, arrived_ms: u64| {
            let age = clock.age(THERE + sent_ms * MS, Nanos(arrived_ms * MS));
            (age.0 + MS / 2) / MS
        };
        assert_eq!(age(1000, 1005), 0, "nothing is known yet");
        assert_eq!(age(1010, 1012), 0, "the quickest so far");
        assert_eq!(age(1020, 1030), 8, "8 ms more than the quickest");
        assert_eq!(age(1030, 3030), 1996, "kept for two seconds");
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

    /// Two clocks: the server's is `lead` ahead at `start` and runs faster by `rate`.
    fn server(client: u64, lead: i64, rate: f64) -> u64 {
        (client + ((client - DAY) as f64 * rate) as u64).saturating_add_signed(lead)
    }

    #[test]
    fn the_bounds_are_those_of_the_smallest_round_trip() {
        let mut offset = ClockOffset::default();
        assert_eq!(offset.there(5, Nanos(5)), None);
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
