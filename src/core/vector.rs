//! Arithmetic on arrays with one value per motor or per output.

/// Combines two arrays entry by entry.
pub(crate) fn zip_map<const N: usize>(
    a: &[f64; N],
    b: &[f64; N],
    combine: impl Fn(f64, f64) -> f64,
) -> [f64; N] {
    let mut result = *a;
    for (value, other) in result.iter_mut().zip(b) {
        *value = combine(*value, *other);
    }
    result
}

pub(crate) fn difference<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    zip_map(a, b, |a, b| a - b)
}

/// Euclidean distance.
pub(crate) fn distance<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    difference(a, b).map(|d| d * d).iter().sum::<f64>().sqrt()
}

/// Largest difference of two entries with the same index.
pub(crate) fn largest_difference<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    difference(a, b).map(f64::abs).into_iter().fold(0.0, f64::max)
}

/// The point on the line from `from` to `to` at `fraction` of its length; exactly `to` from 1 on.
pub(crate) fn interpolate<const N: usize>(
    from: &[f64; N],
    to: &[f64; N],
    fraction: f64,
) -> [f64; N] {
    if fraction >= 1.0 { *to } else { zip_map(from, to, |from, to| from + fraction * (to - from)) }
}

/// The first `entries` values, and 0 for the others.
pub(crate) fn first_entries<const N: usize>(mut values: [f64; N], entries: u32) -> [f64; N] {
    for value in values.iter_mut().skip(entries as usize) {
        *value = 0.0;
    }
    values
}

/// An array from an iterator, filled up with 0.
pub(crate) fn collect<const N: usize>(values: impl Iterator<Item = f64>) -> [f64; N] {
    let mut result = [0.0; N];
    for (to, value) in result.iter_mut().zip(values) {
        *to = value;
    }
    result
}

pub(crate) fn is_finite<const N: usize>(values: &[f64; N]) -> bool {
    values.iter().all(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_and_points_on_a_line() {
        assert_eq!(distance(&[1.0, 2.0], &[4.0, 6.0]), 5.0);
        assert!(distance(&[1.0, f64::NAN], &[4.0, 6.0]).is_nan());
        assert_eq!(largest_difference(&[1.0, 2.0], &[4.0, -6.0]), 8.0);
        assert_eq!(interpolate(&[1.0, 2.0], &[3.0, 6.0], 0.5), [2.0, 4.0]);
        // The end is exact: 0.1 + 1.0 * (0.3 - 0.1) would be another number.
        assert_eq!(interpolate(&[0.1], &[0.3], 1.0), [0.3]);
        assert_eq!(first_entries([1.0, 2.0, f64::NAN], 2), [1.0, 2.0, 0.0]);
        assert_eq!(collect([1.0].into_iter()), [1.0, 0.0]);
    }
}
