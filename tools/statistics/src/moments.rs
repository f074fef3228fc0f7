//! Moments of a sample.

/// The arithmetic mean.
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

/// The square root of [`variance`].
pub fn standard_deviation(values: impl IntoIterator<Item = f64, IntoIter: Clone>) -> Option<f64> {
    variance(values).map(f64::sqrt)
}

/// The root mean square.
pub fn root_mean_square(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    mean(values.into_iter().map(|value| value * value)).map(f64::sqrt)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_follow_their_formulas() {
        let values = [1.0, 2.0, 6.0];
        assert_eq!(mean(values), Some(3.0));
        assert_eq!(variance(values), Some(14.0 / 3.0));
        assert_eq!(standard_deviation(values), Some((14.0_f64 / 3.0).sqrt()));
        assert_eq!(root_mean_square(values), Some((41.0_f64 / 3.0).sqrt()));
    }

    #[test]
    fn no_values_have_no_moments() {
        assert_eq!([mean([]), variance([]), root_mean_square([])], [None; 3]);
    }
}
