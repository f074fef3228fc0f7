//! Slow component of the model error: the residual lies along one direction of the outputs, and
//! changes slowly. A camera can follow it.

use i2ris::model::Model;
use i2ris::model::file::SlowErrorParameters;
use i2ris_report::statistics::median;
use nalgebra::Matrix2;

use super::metrics::predictions;
use crate::recording::Recording;

/// Minimum share of the error along the direction. With less it is not one number.
const MIN_SHARE: f64 = 0.85;

/// Minimum time for which a slow error stays the same, s and rows.
const MIN_TIME_S: f64 = 0.3;
const MIN_CORRELATED_ROWS: f64 = 2.0;

/// Maximum lag of the autocorrelation, and its minimum number of rows.
const LARGEST_LAG: usize = 200;
const MIN_LENGTH: usize = 100;

/// The slow component of the error on these rows; `None` if there is none, or the recording has no
/// time stamps or more than two outputs.
pub(super) fn slow_error(
    model: &Model,
    recording: &Recording,
    rows: &[usize],
) -> Option<SlowErrorParameters> {
    if recording.outputs().len() > 2 || rows.len() < MIN_LENGTH {
        return None;
    }
    let predicted = predictions(model, recording);
    let all = recording.rows();
    let errors = rows.iter().map(|row| {
        let (seen, expected) = (&all[*row].outputs, &predicted[*row]);
        [seen[0] - expected[0], seen[1] - expected[1]]
    });
    let errors: Vec<[f64; 2]> = errors.collect();
    let (direction, along, across) = principal(&errors);
    let share = along / (along + across);
    // Held-out rows come in blocks: the usual interval is that within a block.
    let times: Vec<f64> = rows.iter().filter_map(|row| all[*row].time_s).collect();
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let interval_s = median(&mut intervals)?;
    let series: Vec<f64> =
        errors.iter().map(|error| direction[0] * error[0] + direction[1] * error[1]).collect();
    let time_rows = correlation_time(&series)?;
    let is_slow = time_rows >= MIN_CORRELATED_ROWS && time_rows * interval_s >= MIN_TIME_S;
    (share >= MIN_SHARE && is_slow && interval_s > 0.0).then_some(SlowErrorParameters {
        direction,
        deviation: along.sqrt(),
        time_constant_s: time_rows * interval_s,
        rest: across.sqrt(),
        fast: Some(fast_part(&series).sqrt()),
    })
}

/// The variance of the changes from row to row: the autocovariance of the rest falls exponentially,
/// so its values at lags of one and two rows show its value at lag 0.
fn fast_part(series: &[f64]) -> f64 {
    let covariance = |lag: usize| products(series, lag) / series.len() as f64;
    let [all, one, two] = [0, 1, 2].map(covariance);
    if two > 0.0 { (all - one * one / two).max(0.0) } else { all }
}

/// Sum of the products of values that are this many rows apart.
fn products(series: &[f64], lag: usize) -> f64 {
    series.iter().zip(series.get(lag..).unwrap_or_default()).map(|(a, b)| a * b).sum()
}

/// The direction of the largest variance around 0, and the variances along and across it.
fn principal(errors: &[[f64; 2]]) -> ([f64; 2], f64, f64) {
    let product = |[a, b]: &[f64; 2]| Matrix2::new(a * a, a * b, a * b, b * b);
    let variances = errors.iter().map(product).sum::<Matrix2<f64>>() / errors.len() as f64;
    let found = variances.symmetric_eigen();
    let along = found.eigenvalues.imax();
    let direction = found.eigenvectors.column(along);
    let across = found.eigenvalues[1 - along].max(0.0);
    ([direction[0], direction[1]], found.eigenvalues[along], across)
}

/// The number of rows after which the autocorrelation around 0 has fallen to 1/e.
fn correlation_time(series: &[f64]) -> Option<f64> {
    let square = products(series, 0);
    let correlation = |lag: usize| {
        let scale = series.len() as f64 / (series.len() - lag) as f64;
        scale * products(series, lag) / square
    };
    let limit = (-1.0_f64).exp();
    let mut before = 1.0;
    for lag in 1..LARGEST_LAG.min(series.len() / 2) {
        let now = correlation(lag);
        if now.is_nan() {
            return None;
        }
        if now < limit {
            return Some(lag as f64 - (limit - now) / (before - now));
        }
        before = now;
    }
    Some(LARGEST_LAG as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow number along a direction, and a fast one across it.
    fn errors(direction: [f64; 2]) -> Vec<[f64; 2]> {
        let mut slow = 0.0;
        let mut state = 1_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
        };
        let next = |_| {
            slow += -0.05 * slow + noise();
            let fast = 0.3 * noise();
            [slow * direction[0] - fast * direction[1], slow * direction[1] + fast * direction[0]]
        };
        (0..20_000).map(next).collect()
    }

    #[test]
    fn direction_and_correlation_time_are_found() {
        let (direction, along, across) = principal(&errors([-0.8, 0.6]));
        let cosine = (direction[0] * -0.8 + direction[1] * 0.6).abs();
        assert!(cosine > 0.999, "{direction:?}");
        assert!(along > 20.0 * across, "{along} {across}");
        let series: Vec<f64> = errors([1.0, 0.0]).iter().map(|error| error[0]).collect();
        let time = correlation_time(&series).unwrap();
        assert!((16.0..25.0).contains(&time), "{time}");
    }

    #[test]
    fn fast_and_slow_variance_are_separated() {
        let all = errors([1.0, 0.0]);
        let slow: Vec<f64> = all.iter().map(|error| error[0]).collect();
        // Uniform between -0.5 and 0.5: a variance of 1/12.
        assert!(fast_part(&slow) < 0.02, "{}", fast_part(&slow));
        let both: Vec<f64> = all.iter().map(|error| error[0] + error[1] / 0.3).collect();
        let found = 12.0 * fast_part(&both);
        assert!((0.7..1.3).contains(&found), "{found}");
    }
}
