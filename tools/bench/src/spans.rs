//! Many spans, and the few numbers that tell of them.

use hdrhistogram::Histogram;
use i2ris::units::Nanos;
use serde::Serialize;

/// Longer spans count as this one: a minute.
const LONGEST_NS: u64 = 60_000_000_000;

/// Digits of a span that are kept.
const DIGITS: u8 = 3;

/// A histogram of spans; the first ones, in which caches and clocks warm up, are not counted.
#[derive(Debug, Clone)]
pub struct Spans {
    histogram: Histogram<u64>,
    warm_up: u64,
}

/// Percentiles, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// How many spans there are.
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

impl Spans {
    /// Without the first `warm_up` spans.
    ///
    /// # Panics
    ///
    /// Never: the bounds of the histogram are constants that its constructor takes.
    #[must_use]
    #[allow(clippy::expect_used, reason = "see above; a test makes one")]
    pub fn new(warm_up: u64) -> Self {
        let histogram = Histogram::new_with_bounds(1, LONGEST_NS, DIGITS).expect("constant bounds");
        Self { histogram, warm_up }
    }

    /// Takes a span.
    pub fn push(&mut self, span: Nanos) {
        match self.warm_up {
            0 => self.histogram.saturating_record(span.0.max(1)),
            _ => self.warm_up -= 1,
        }
    }

    /// Takes what another one has counted.
    pub fn add(&mut self, other: &Self) {
        // Only a histogram of a wider range is refused, and all have the same.
        let _ = self.histogram.add(&other.histogram);
    }

    /// Whether nothing was counted.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.histogram.is_empty()
    }

    /// As counted.
    #[must_use]
    pub fn histogram(&self) -> &Histogram<u64> {
        &self.histogram
    }

    /// The numbers.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let at = |share| self.histogram.value_at_quantile(share);
        Summary {
            count: self.histogram.len(),
            p50: at(0.5),
            p90: at(0.9),
            p99: at(0.99),
            p999: at(0.999),
            max: self.histogram.max(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_warm_up_does_not_count() {
        let mut spans = Spans::new(10);
        (0..10).for_each(|_| spans.push(Nanos(1_000_000_000)));
        (1..=1000).for_each(|ns| spans.push(Nanos(ns)));
        let Summary {
            count,
            p50,
            p99,
            max,
            ..
        } = spans.summary();
        assert_eq!((count, p50, max), (1000, 500, 1000));
        assert!((989..=991).contains(&p99), "{p99}");
    }

    #[test]
    fn turns_add_up() {
        let (mut all, mut turn) = (Spans::new(0), Spans::new(0));
        assert!(all.is_empty());
        turn.push(Nanos(100));
        all.add(&turn);
        all.add(&turn);
        turn.push(Nanos(u64::MAX));
        all.add(&turn);
        assert_eq!(all.summary().count, 4);
        assert!(
            all.summary().max <= LONGEST_NS + LONGEST_NS / 1000,
            "what is longer counts as the longest"
        );
    }
}
