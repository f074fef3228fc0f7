//! Many spans, and the few numbers that tell of them.

use hdrhistogram::Histogram;
use i2ris::units::Nanos;
use serde::Serialize;

use crate::Failure;

/// Longer spans count as this one: a minute.
const LONGEST_NS: u64 = 60_000_000_000;

/// A histogram of spans; the first ones, in which caches and clocks warm up, are not counted.
#[derive(Debug)]
pub struct Spans {
    histogram: Histogram<u64>,
    warm_up: u64,
}

/// Percentiles, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Summary {
    pub count: u64,
    pub p50: u64,
    pub p90: u64,
    pub p99: u64,
    pub p999: u64,
    pub max: u64,
}

impl Spans {
    /// Three digits, from a nanosecond to a minute.
    pub fn new(warm_up: u64) -> Result<Self, Failure> {
        Ok(Self { histogram: Histogram::new_with_bounds(1, LONGEST_NS, 3)?, warm_up })
    }

    /// Takes a span.
    pub fn push(&mut self, span: Nanos) {
        match self.warm_up {
            0 => self.histogram.saturating_record(span.0.max(1)),
            _ => self.warm_up -= 1,
        }
    }

    /// The numbers.
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
        let mut spans = Spans::new(10).unwrap();
        (0..10).for_each(|_| spans.push(Nanos(1_000_000_000)));
        (1..=1000).for_each(|ns| spans.push(Nanos(ns)));
        let Summary { count, p50, p99, max, .. } = spans.summary();
        assert_eq!((count, p50, max), (1000, 500, 1000));
        assert!((989..=991).contains(&p99), "{p99}");
    }
}
