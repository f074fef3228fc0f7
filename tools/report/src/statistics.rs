//! Statistics and distances of plain numbers.
//!
//! A statistic of no values is `None`. No function checks for values that are not finite: the
//! caller leaves them out. For histograms of durations with a fixed resolution use the crate
//! `hdrhistogram`.

use std::ops::Deref;

pub fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (count, sum) =
        values.into_iter().fold((0_usize, 0.0), |(count, sum), value| (count + 1, sum + value));
    (count > 0).then(|| sum / count as f64)
}

/// The population variance: the mean square of the deviations from the mean.
pub fn variance(values: impl IntoIterator<Item = f64, IntoIter: Clone>) -> Option<f64> {
    let values = values.into_iter();
    let centre = mean(values.clone())?;
    mean(values.map(|value| (value - centre) * (value - centre)))
}

pub fn root_mean_square(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    mean(values.into_iter().map(|value| value * value)).map(f64::sqrt)
}

/// Sorts values in rising order; NaN comes after infinity.
pub fn sort(values: &mut [f64]) {
    values.sort_unstable_by(f64::total_cmp);
}

/// The least value that at least a share of all values does not exceed (nearest rank).
/// `probability` is from 0 to 1, `sorted` in rising order.
pub fn quantile(sorted: &[f64], probability: f64) -> Option<f64> {
    sorted.get(rank(sorted.len(), probability)?).copied()
}

/// [`quantile`] of values in any order. Reorders the values.
pub fn quantile_of_unsorted(values: &mut [f64], probability: f64) -> Option<f64> {
    let rank = rank(values.len(), probability)?;
    Some(*values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

/// The middle value; the upper one of two. Reorders the values.
pub fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Index of the nearest rank; `None` for no values.
fn rank(count: usize, probability: f64) -> Option<usize> {
    let last = count.checked_sub(1)?;
    let rank = (probability * count as f64).ceil() as usize;
    Some(rank.saturating_sub(1).min(last))
}

/// The lowest and the highest value; infinity and minus infinity for no values.
pub fn min_max(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let values = values.into_iter();
    values.fold(ends, |(low, high), value| (low.min(value), high.max(value)))
}

/// How many values are in each bin. Bin `i` is from `edges[i]` up to, but without, `edges[i + 1]`;
/// the edges are in rising order. Values outside all bins are not counted.
pub fn histogram(values: impl IntoIterator<Item = f64>, edges: &[f64]) -> Vec<u64> {
    let mut counts = vec![0; edges.len().saturating_sub(1)];
    for value in values {
        let above = edges.partition_point(|edge| *edge <= value);
        if let Some(count) = above.checked_sub(1).and_then(|bin| counts.get_mut(bin)) {
            *count += 1;
        }
    }
    counts
}

/// The Euclidean distance. It is NaN if a coordinate is NaN.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

/// The largest difference of a coordinate (Chebyshev distance).
pub fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}

/// Distance from a point to a line segment in the plane.
pub fn distance_to_segment(point: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let square = dx * dx + dy * dy;
    let along = (point[0] - from[0]) * dx + (point[1] - from[1]) * dy;
    let share = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
    (point[0] - from[0] - share * dx).hypot(point[1] - from[1] - share * dy)
}

/// The point on the straight line between two points: `from` at a share of 0, `to` at 1.
pub fn interpolate<const N: usize>(from: &[f64; N], to: &[f64; N], share: f64) -> [f64; N] {
    std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
}

/// A quantity sampled over time, in the order of its stamps.
#[derive(Debug, Clone, Default)]
pub struct TimeSeries<const N: usize> {
    samples: Vec<(u64, [f64; N])>,
}

impl<const N: usize> TimeSeries<N> {
    /// Drops a sample that is not newer than the last one: streams repeat their last value.
    pub fn push(&mut self, stamp_ns: u64, value: [f64; N]) {
        if self.samples.last().is_none_or(|(last, _)| stamp_ns > *last) {
            self.samples.push((stamp_ns, value));
        }
    }

    /// The value at an instant, interpolated linearly between the samples around it; `None` outside
    /// the series, and if these samples are further apart than `gap_ns`.
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
}

/// Reads as a slice of stamps in ns and values.
impl<const N: usize> Deref for TimeSeries<N> {
    type Target = [(u64, [f64; N])];

    fn deref(&self) -> &Self::Target {
        &self.samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_follow_their_formulas() {
        let values = [1.0, 2.0, 6.0];
        assert_eq!(mean(values), Some(3.0));
        assert_eq!(variance(values), Some(14.0 / 3.0));
        assert_eq!(root_mean_square(values), Some((41.0_f64 / 3.0).sqrt()));
    }

    #[test]
    fn quantiles_are_nearest_rank_in_any_order() {
        let sorted: Vec<f64> = (1..=100).map(f64::from).collect();
        for (probability, expected) in [(0.0, 1.0), (0.5, 50.0), (0.991, 100.0), (1.0, 100.0)] {
            let mut reversed: Vec<f64> = sorted.iter().rev().copied().collect();
            assert_eq!(quantile(&sorted, probability), Some(expected));
            assert_eq!(quantile_of_unsorted(&mut reversed, probability), Some(expected));
            sort(&mut reversed);
            assert_eq!(reversed, sorted);
        }
    }

    #[test]
    fn a_value_on_an_edge_is_in_the_bin_above() {
        let edges = [-1.0, 0.0, 1.0];
        assert_eq!(histogram([-0.5, 0.0, 0.5, 7.0], &edges), [1, 2]);
        assert_eq!(histogram([-2.0, -1.0, 1.0], &edges), [1, 0]);
        assert_eq!(histogram([1.0], &[]), [0; 0]);
    }

    #[test]
    fn distances_follow_their_formulas() {
        assert_eq!(distance(&[1.0, 2.0, 0.0], &[4.0, 6.0, 0.0]), 5.0);
        assert_eq!(largest_difference(&[1.0, 2.0], &[4.0, -2.0]), 4.0);
        assert!(distance(&[f64::NAN], &[0.0]).is_nan());
        assert_eq!(interpolate(&[0.0, 10.0], &[4.0, 20.0], 0.25), [1.0, 12.5]);
    }

    #[test]
    fn beyond_the_ends_of_a_segment_its_end_is_nearest() {
        let [from, to] = [[0.0, 0.0], [10.0, 0.0]];
        assert_eq!(distance_to_segment([5.0, 3.0], from, to), 3.0);
        assert_eq!(distance_to_segment([13.0, 4.0], from, to), 5.0);
        assert_eq!(distance_to_segment([3.0, 4.0], from, from), 5.0);
    }

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
}
