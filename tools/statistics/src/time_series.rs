//! Values over time, interpolated to instants of other streams.

use crate::distance::interpolate;

/// A quantity sampled over time, in the order of its stamps.
#[derive(Debug, Clone)]
pub struct TimeSeries<const N: usize> {
    samples: Vec<(u64, [f64; N])>,
}

impl<const N: usize> Default for TimeSeries<N> {
    fn default() -> Self {
        Self { samples: Vec::new() }
    }
}

impl<const N: usize> TimeSeries<N> {
    /// Adds a sample. A sample that is not newer than the last one is dropped: streams repeat their
    /// last value.
    pub fn push(&mut self, stamp_ns: u64, value: [f64; N]) {
        if self.samples.last().is_none_or(|(last, _)| stamp_ns > *last) {
            self.samples.push((stamp_ns, value));
        }
    }

    /// The value at an instant, interpolated linearly between the samples around it; `None` outside
    /// the series, and if these samples are further apart than `gap_ns`.
    #[must_use]
    pub fn value_at(&self, stamp_ns: u64, gap_ns: u64) -> Option<[f64; N]> {
        let after = self.samples.partition_point(|(stamp, _)| *stamp < stamp_ns);
        let (t1, b) = self.samples.get(after)?;
        if *t1 == stamp_ns {
            return Some(*b);
        }
        let (t0, a) = self.samples.get(after.checked_sub(1)?)?;
        let share = (stamp_ns - t0) as f64 / (t1 - t0) as f64;
        (t1 - t0 <= gap_ns).then(|| interpolate(a, b, share))
    }

    /// All samples: stamps in ns, and values.
    pub fn iter(&self) -> impl Iterator<Item = &(u64, [f64; N])> {
        self.samples.iter()
    }

    /// A sample by its index.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<&(u64, [f64; N])> {
        self.samples.get(index)
    }

    /// The newest sample.
    #[must_use]
    pub fn last(&self) -> Option<&(u64, [f64; N])> {
        self.samples.last()
    }

    /// Whether the series has no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_interpolated_but_not_across_gaps_or_ends() {
        let mut series = TimeSeries::default();
        series.push(100, [0.0]);
        series.push(200, [10.0]);
        for (stamp, gap, expected) in [
            (130, 1000, Some([3.0])),
            (200, 1000, Some([10.0])),
            (150, 50, None),
            (99, 1000, None),
            (201, 1000, None),
        ] {
            assert_eq!(series.value_at(stamp, gap), expected);
        }
    }

    #[test]
    fn repeated_stamps_are_dropped() {
        let mut series = TimeSeries::default();
        series.push(100, [0.0]);
        series.push(100, [5.0]);
        assert_eq!(series.iter().count(), 1);
    }
}
