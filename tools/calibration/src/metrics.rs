//! How well predictions agree with measurements.

use i2ris::model::Model;
use i2ris::model::file::FitMetrics;
use i2ris::units::{MAX_OUTPUTS, OutputVec};

use crate::recording::{Recording, Row};

/// What a model says at every row of a recording, in the units of the recording; entries beyond the
/// number of outputs are 0. The code is that of the controller, and its memory follows the way of
/// the motors from the first position on.
#[must_use]
pub fn predictions(model: &Model, recording: &Recording) -> Vec<[f64; MAX_OUTPUTS]> {
    let mut memory = model.new_memory();
    let mut next = 0;
    let mut predict = |row: &Row| {
        let way = recording.path().get(next..=row.place).unwrap_or_default();
        way.iter()
            .for_each(|position| model.advance(&mut memory, &position.counts));
        next = row.place + 1;
        in_file_units(&model.predict(&row.counts, &memory).mean, recording)
    };
    recording.rows().iter().map(&mut predict).collect()
}

fn in_file_units(outputs: &OutputVec, recording: &Recording) -> [f64; MAX_OUTPUTS] {
    let mut values = [0.0; MAX_OUTPUTS];
    for ((value, output), spec) in values.iter_mut().zip(outputs).zip(recording.outputs()) {
        *value = output / spec.unit.si();
    }
    values
}

/// Metrics of one output over pairs of measured and predicted values. `None` for fewer than two
/// rows, or where the measured values are all the same: without a range, neither R2 nor NRMSD has a
/// meaning.
///
/// ```text
/// R2    = 1 - sum (measured - predicted)^2 / sum (measured - mean)^2
/// RMSD  = sqrt(mean (measured - predicted)^2)
/// NRMSD = RMSD / (highest measured - lowest measured)
/// MAE   = mean |measured - predicted|
/// ```
#[must_use]
pub fn metrics(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Option<FitMetrics> {
    let rows = pairs.clone().count() as f64;
    let measured = pairs.clone().map(|(measured, _)| measured);
    let (low, high) = measured
        .clone()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), m| {
            (l.min(m), h.max(m))
        });
    if rows < 2.0 || low >= high {
        return None;
    }
    let mean = measured.clone().sum::<f64>() / rows;
    let variation: f64 = measured.map(|measured| (measured - mean).powi(2)).sum();
    let errors = pairs.map(|(measured, predicted)| (measured - predicted).abs());
    let squares: f64 = errors.clone().map(|error| error * error).sum();
    let rmsd = (squares / rows).sqrt();
    Some(FitMetrics {
        r2: 1.0 - squares / variation,
        rmsd,
        nrmsd: rmsd / (high - low),
        mae: errors.clone().sum::<f64>() / rows,
        max: errors.fold(0.0, f64::max),
    })
}

/// The value that a share of all values does not exceed, by nearest rank; `None` for no values.
/// Puts them in order.
#[must_use]
pub fn percentile(values: &mut [f64], share: f64) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let rank = (share * values.len() as f64).ceil() as usize;
    values.get(rank.clamp(1, values.len().max(1)) - 1).copied()
}

/// Length of the error over the first `outputs` outputs.
#[must_use]
pub fn length(
    measured: &[f64; MAX_OUTPUTS],
    predicted: &[f64; MAX_OUTPUTS],
    outputs: usize,
) -> f64 {
    measured
        .iter()
        .zip(predicted)
        .take(outputs)
        .map(|(m, p)| (m - p) * (m - p))
        .sum::<f64>()
        .sqrt()
}

/// Root mean square; `None` for no values.
#[must_use]
pub fn root_mean_square(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0_usize, 0.0), |(count, sum), value| {
        (count + 1, sum + value * value)
    });
    (count > 0).then(|| (sum / count as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_metrics_follow_their_formulas() {
        let found = metrics([(1.0, 1.0), (2.0, 3.0), (5.0, 3.0)].into_iter()).unwrap();
        // Mean 8/3, variation 26/3, squared errors 0 + 1 + 4, range 4.
        let expected = FitMetrics {
            r2: 1.0 - 15.0 / 26.0,
            rmsd: (5.0_f64 / 3.0).sqrt(),
            nrmsd: (5.0_f64 / 3.0).sqrt() / 4.0,
            mae: 1.0,
            max: 2.0,
        };
        for (found, expected) in [
            (found.r2, expected.r2),
            (found.rmsd, expected.rmsd),
            (found.nrmsd, expected.nrmsd),
            (found.mae, expected.mae),
            (found.max, expected.max),
        ] {
            assert!(
                (found - expected).abs() < 1e-15,
                "{found} instead of {expected}"
            );
        }
    }

    #[test]
    fn what_never_changes_has_no_metrics() {
        assert_eq!(metrics([(3.0, 1.0), (3.0, 2.0)].into_iter()), None);
        assert_eq!(metrics([(3.0, 1.0)].into_iter()), None);
        assert_eq!(metrics(std::iter::empty()), None);
    }

    #[test]
    fn percentiles_are_by_nearest_rank() {
        let mut values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(
            [0.0, 0.5, 0.99, 1.0].map(|share| percentile(&mut values, share).unwrap()),
            [1.0, 50.0, 99.0, 100.0]
        );
        assert_eq!(percentile(&mut [], 0.5), None);
    }

    #[test]
    fn lengths_are_over_the_outputs_that_there_are() {
        assert_eq!(length(&[3.0, 4.0, 9.0], &[0.0, 0.0, 0.0], 2), 5.0);
        assert_eq!(
            root_mean_square([3.0, -4.0].into_iter()),
            Some(12.5_f64.sqrt())
        );
        assert_eq!(root_mean_square(std::iter::empty()), None);
    }

    proptest! {
        #[test]
        fn errors_are_ordered(pairs in prop::collection::vec((-50.0..50.0, -50.0..50.0), 2..60)) {
            let m = metrics(pairs.into_iter()).unwrap();
            prop_assert!(0.0 <= m.mae && m.mae <= m.rmsd * (1.0 + 1e-12) && m.rmsd <= m.max * (1.0 + 1e-12));
            prop_assert!(m.r2 <= 1.0);
        }
    }
}
