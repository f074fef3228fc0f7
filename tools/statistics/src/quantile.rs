//! Quantiles of a sample.

/// Sorts values in rising order. NaN is sorted behind infinity.
pub fn sort(values: &mut [f64]) {
    values.sort_unstable_by(f64::total_cmp);
}

/// The least value that at least a share of all values does not exceed (nearest rank).
/// `probability` is from 0 to 1, `sorted` in rising order.
#[must_use]
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
#[must_use]
pub fn min_max(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let values = values.into_iter();
    values.fold(ends, |(low, high), value| (low.min(value), high.max(value)))
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn the_median_is_the_upper_one_of_two() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), Some(3.0));
    }

    #[test]
    fn no_values_have_no_quantiles() {
        assert_eq!(quantile(&[], 0.5), None);
        assert_eq!(quantile_of_unsorted(&mut [], 0.5), None);
        assert_eq!(median(&mut []), None);
    }
}
