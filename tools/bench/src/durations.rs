//! A histogram of durations and its percentiles.

use hdrhistogram::Histogram;
use i2ris::units::Nanos;
use serde::Serialize;

/// Longer durations count as this one: a minute.
const LONGEST_NS: u64 = 60_000_000_000;

/// Significant digits of a duration.
const DIGITS: u8 = 3;

/// A histogram of durations. The first durations, in which caches and clocks warm up, do not count.
#[derive(Debug, Clone)]
pub struct Durations {
    histogram: Histogram<u64>,
    warm_up: u64,
}

/// Percentiles, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct DurationPercentiles {
    /// Number of durations.
    pub count: u64,
    /// Median.
    pub p50: u64,
    /// 90th percentile.
    pub p90: u64,
    /// 99th percentile.
    pub p99: u64,
    /// 99.9th percentile.
    pub p999: u64,
    /// Largest.
    pub max: u64,
}

impl Durations {
    /// An empty histogram, which leaves out the first `warm_up` durations.
    ///
    /// # Panics
    ///
    /// Never: the bounds of the histogram are valid constants.
    #[must_use]
    #[allow(clippy::expect_used, reason = "see above; a test makes one")]
    pub fn new(warm_up: u64) -> Self {
        let histogram = Histogram::new_with_bounds(1, LONGEST_NS, DIGITS).expect("constant bounds");
        Self { histogram, warm_up }
    }

    /// Adds a duration.
    pub fn push(&mut self, duration: Nanos) {
        match self.warm_up {
            0 => self.histogram.saturating_record(duration.0.max(1)),
            _ => self.warm_up -= 1,
        }
    }

    /// Adds all durations of another histogram.
    pub fn add(&mut self, other: &Self) {
        // Only a histogram with a wider range is refused, and all have the same range.
        let _ = self.histogram.add(&other.histogram);
    }

    /// Whether there are no durations.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.histogram.is_empty()
    }

    /// The histogram, ns.
    #[must_use]
    pub fn histogram(&self) -> &Histogram<u64> {
        &self.histogram
    }

    /// Percentiles of all durations.
    #[must_use]
    pub fn percentiles(&self) -> DurationPercentiles {
        let quantile = |share| self.histogram.value_at_quantile(share);
        DurationPercentiles {
            count: self.histogram.len(),
            p50: quantile(0.5),
            p90: quantile(0.9),
            p99: quantile(0.99),
            p999: quantile(0.999),
            max: self.histogram.max(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_warm_up_does_not_count() {
        let mut durations = Durations::new(10);
        let first = std::iter::repeat_n(1_000_000_000, 10);
        for ns in first.chain(1..=1000) {
            durations.push(Nanos(ns));
        }
        let found = durations.percentiles();
        assert_eq!((found.count, found.p50, found.max), (1000, 500, 1000));
        assert!((989..=991).contains(&found.p99), "{found:?}");
    }

    #[test]
    fn histograms_add_up_and_limit_long_durations() {
        let (mut all, mut turn) = (Durations::new(0), Durations::new(0));
        assert!(all.is_empty());
        turn.push(Nanos(100));
        all.add(&turn);
        all.add(&turn);
        turn.push(Nanos(u64::MAX));
        all.add(&turn);
        assert_eq!(all.percentiles().count, 4);
        assert!(all.percentiles().max <= LONGEST_NS + LONGEST_NS / 1000);
    }
}
