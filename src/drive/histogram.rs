//! A small histogram of round trips, copied with the counters of a line: no allocation, no
//! division.

use crate::units::Nanos;

/// Buckets, four to a doubling, from 0.25 ms: bucket 0 holds what is shorter, the last what is
/// longer than 1 s.
const BUCKETS: usize = 49;

/// The upper end of bucket 0.
const FIRST: u64 = 250_000;

/// Counts of spans by length, four buckets to a doubling: a quantile is right within a quarter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Histogram {
    counts: [u32; BUCKETS],
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            counts: [0; BUCKETS],
        }
    }
}

impl Histogram {
    /// Adds a span.
    pub fn record(&mut self, span: Nanos) {
        if let Some(count) = self.counts.get_mut(bucket(span)) {
            *count = count.saturating_add(1);
        }
    }

    /// How many spans were added.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.counts.iter().map(|count| u64::from(*count)).sum()
    }

    /// The upper end of the bucket in which the quantile lies, 0 to 1; `None` without spans.
    #[must_use]
    pub fn quantile(&self, quantile: f64) -> Option<Nanos> {
        let total = self.count();
        let rank = ((quantile.clamp(0.0, 1.0) * total as f64).ceil() as u64).max(1);
        let mut below = 0;
        let place = self.counts.iter().position(|count| {
            below += u64::from(*count);
            below >= rank
        })?;
        Some(upper_end(place))
    }

    /// Every bucket that holds something, as upper end and count.
    pub fn buckets(&self) -> impl Iterator<Item = (Nanos, u32)> {
        let held = self
            .counts
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0);
        held.map(|(place, count)| (upper_end(place), *count))
    }
}

/// The bucket of a span: the doubling above the first end, and the quarter of it.
fn bucket(span: Nanos) -> usize {
    if span.0 < FIRST {
        return 0;
    }
    let ratio = span.0 / FIRST;
    let doubling = ratio.ilog2();
    let quarter = (span.0 - (FIRST << doubling)) * 4 / (FIRST << doubling);
    (1 + 4 * doubling as usize + quarter as usize).min(BUCKETS - 1)
}

fn upper_end(place: usize) -> Nanos {
    match place.checked_sub(1) {
        None => Nanos(FIRST),
        Some(above) => {
            let (doubling, quarter) = (above / 4, above % 4);
            Nanos((FIRST << doubling) / 4 * (5 + quarter as u64))
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn quantiles_are_right_within_a_quarter() {
        let mut histogram = Histogram::default();
        (1..=1000u64).for_each(|step| histogram.record(Nanos::from_micros(10 * step)));
        assert_eq!(histogram.count(), 1000);
        for (quantile, exact_us) in [(0.5, 5000), (0.9, 9000), (0.99, 9900)] {
            let found = histogram.quantile(quantile).unwrap();
            assert!(
                found >= Nanos::from_micros(exact_us) && found.0 <= exact_us * 1250,
                "{quantile}: {found:?}"
            );
        }
        assert_eq!(Histogram::default().quantile(0.5), None);
    }

    proptest! {
        #[test]
        fn a_span_lies_below_the_end_of_its_bucket_and_above_the_one_before(span in 0..900_000_000u64) {
            let place = bucket(Nanos(span));
            prop_assert!(Nanos(span) < upper_end(place), "{} {:?}", place, upper_end(place));
            prop_assert!(place == 0 || Nanos(span) >= upper_end(place - 1));
        }
    }
}
