//! Values over time from several streams, brought to common instants.

/// A quantity sampled over time, in the order of its stamps.
#[derive(Debug, Clone)]
pub struct Series<const N: usize> {
    samples: Vec<(u64, [f64; N])>,
}

impl<const N: usize> Default for Series<N> {
    fn default() -> Self {
        Self {
            samples: Vec::new(),
        }
    }
}

impl<const N: usize> Series<N> {
    /// Adds a sample. One that is not newer than the last is dropped: streams repeat their last
    /// value.
    pub fn push(&mut self, stamp_ns: u64, value: [f64; N]) {
        if self.samples.last().is_none_or(|(last, _)| stamp_ns > *last) {
            self.samples.push((stamp_ns, value));
        }
    }

    /// Whether there is nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The value at an instant, linearly between the samples around it; `None` outside the
    /// recording, or when they are further apart than `gap_ns`.
    #[must_use]
    pub fn at(&self, stamp_ns: u64, gap_ns: u64) -> Option<[f64; N]> {
        let after = self.samples.partition_point(|(stamp, _)| *stamp < stamp_ns);
        let (t1, b) = *self.samples.get(after)?;
        if t1 == stamp_ns {
            return Some(b);
        }
        let (t0, a) = *self.samples.get(after.checked_sub(1)?)?;
        if t1 - t0 > gap_ns {
            return None;
        }
        let share = (stamp_ns - t0) as f64 / (t1 - t0) as f64;
        Some(std::array::from_fn(|i| a[i] + share * (b[i] - a[i])))
    }

    /// A sample by its number.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<&(u64, [f64; N])> {
        self.samples.get(index)
    }

    /// The newest sample.
    #[must_use]
    pub fn last(&self) -> Option<&(u64, [f64; N])> {
        self.samples.last()
    }

    /// All samples.
    pub fn iter(&self) -> impl Iterator<Item = &(u64, [f64; N])> {
        self.samples.iter()
    }
}

/// The value below which a share of the sorted values lies (nearest rank); NaN for none.
#[must_use]
pub fn percentile(sorted: &[f64], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted
        .get(rank.clamp(1, sorted.len().max(1)) - 1)
        .copied()
        .unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_samples_the_value_is_linear() {
        let mut series = Series::default();
        series.push(100, [0.0]);
        series.push(200, [10.0]);
        assert_eq!(series.at(130, 1000), Some([3.0]));
        assert_eq!(series.at(200, 1000), Some([10.0]));
    }

    #[test]
    fn outside_and_in_gaps_there_is_no_value() {
        let mut series = Series::default();
        series.push(100, [0.0]);
        series.push(200, [10.0]);
        assert_eq!(series.at(99, 1000), None);
        assert_eq!(series.at(201, 1000), None);
        assert_eq!(series.at(150, 50), None);
    }

    #[test]
    fn repeated_stamps_are_dropped() {
        let mut series = Series::default();
        series.push(100, [0.0]);
        series.push(100, [5.0]);
        assert_eq!(series.iter().count(), 1);
    }

    #[test]
    fn percentiles_are_nearest_rank() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(percentile(&values, 0.5), 50.0);
        assert_eq!(percentile(&values, 0.99), 99.0);
        assert_eq!(percentile(&values, 1.0), 100.0);
        assert!(percentile(&[], 0.5).is_nan());
    }
}
