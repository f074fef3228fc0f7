//! Statistics of plain numbers.

/// The root mean square; `None` for no values.
#[must_use]
pub fn root_mean_square(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (mut count, mut sum) = (0_usize, 0.0);
    for value in values {
        count += 1;
        sum += value * value;
    }
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// Puts values in rising order.
pub fn sort(values: &mut [f64]) {
    values.sort_unstable_by(f64::total_cmp);
}

/// The value of sorted ones that a share of all values does not exceed, by nearest rank; `None`
/// for no values.
#[must_use]
pub fn quantile(sorted: &[f64], probability: f64) -> Option<f64> {
    let rank = (probability * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied()
}

/// The same of values in any order; reorders them.
#[must_use]
pub fn quantile_of_unsorted(values: &mut [f64], probability: f64) -> Option<f64> {
    sort(values);
    quantile(values, probability)
}

/// The median, the upper one of two; `None` for no values. Reorders the values.
#[must_use]
pub fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The lowest and the highest value; infinity and minus infinity for no values.
#[must_use]
pub fn min_max(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let values = values.into_iter();
    values.fold(ends, |(low, high), value| (low.min(value), high.max(value)))
}

/// The Euclidean distance.
#[must_use]
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_by_nearest_rank() {
        let mut values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        let shares = [0.0, 0.5, 0.99, 1.0];
        let found = shares.map(|share| quantile_of_unsorted(&mut values, share));
        assert_eq!(found, [1.0, 50.0, 99.0, 100.0].map(Some));
        assert_eq!(quantile(&[], 0.5), None);
        assert_eq!((median(&mut values), median(&mut [])), (Some(51.0), None));
    }

    #[test]
    fn lengths_follow_their_formulas() {
        assert_eq!(distance(&[3.0, 4.0], &[0.0, 0.0]), 5.0);
        assert_eq!(root_mean_square([3.0, -4.0]), Some(12.5_f64.sqrt()));
        assert_eq!(root_mean_square([]), None);
    }
}
